"""The pictures of a report, each with the command that makes it and how it came about."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from koopcli.config.changes import flat, parse_set
from koopcli.config.experiment import Experiment
from koopcli.errors import InvalidValueError, UsageError
from koopcli.figures.kit.figure import Drawing, FigureKind
from koopcli.figures.kit.registry import FIGURES
from koopcli.reproduction.report import Picture, Plan, Run
from koopcli.stages import figure_tasks
from koopcli.stages.base import Task
from koopcli.stages.effects import why_idle
from koopcli.stages.naming import names
from koopcli.stages.pipeline import Artefact, Pipeline
from koopcli.store import Record


@dataclass(frozen=True)
class Illustration:
    """A picture of a report: its ``drawing`` with its ``record`` and those of what it ``draws``, or why there is none.

    ``command`` makes it; one that ``leads`` may open the report.
    """

    figure: str
    caption: str
    run: str
    command: str
    drawing: Drawing | None
    record: Record | None
    draws: tuple[Record, ...]
    reason: str = ""
    leads: bool = False


def illustrate(plans: Sequence[Plan], pipeline: Pipeline) -> list[Illustration]:
    """Make or find every picture of the plans of a method; one that two runs share is shown once.

    What cannot be drawn, as an evaluation where every prediction diverged, is left out with the reason.
    """
    illustrations = []
    wanted = _wanted(plans)
    with pipeline.reporter.progress(f"figures of {plans[0].method.name}") as progress:
        for i, (run, picture) in enumerate(wanted):
            progress(i, len(wanted))
            try:
                illustrations.append(_drawn(run, picture, pipeline.make(picture.task), pipeline))
            except InvalidValueError as error:
                illustrations.append(_undrawn(run, picture, str(error)))
    return illustrations


def illustrations_there(plans: Sequence[Plan], pipeline: Pipeline, reason: str) -> list[Illustration]:
    """The pictures of the plans that the store has, and why there are no others; nothing is made."""
    return [
        _undrawn(run, picture, reason) if artefact is None else _drawn(run, picture, artefact, pipeline)
        for run, picture in _wanted(plans)
        for artefact in [pipeline.there(picture.task)]
    ]


def _wanted(plans: Sequence[Plan]) -> list[tuple[Run, Picture]]:
    """Every picture once, with the first run that it is of."""
    wanted: dict[Task, tuple[Run, Picture]] = {}
    for plan in plans:
        for picture in plan.pictures:
            wanted.setdefault(picture.task, (plan.run, picture))
    return list(wanted.values())


def _undrawn(run: Run, picture: Picture, reason: str) -> Illustration:
    name = picture.task.settings.figure
    return Illustration(name, picture.caption, run.label, "", None, None, (), reason, picture.leads)


def _drawn(run: Run, picture: Picture, made: Artefact, pipeline: Pipeline) -> Illustration:
    name = picture.task.settings.figure
    main = FIGURES[name].roles[:1]  # the artefact itself comes first
    inputs = {tuple(key.split("/")): full for key, full in made.record.lineage.items()}
    names = [full for (_, role), full in sorted(inputs.items(), key=lambda item: int(item[0][0])) if (role,) == main]
    records = (pipeline.store.record(*full.split("/")) for full in names)
    draws = tuple(record for record in records if record is not None)
    making = command(run, picture, draws)
    return Illustration(name, picture.caption, run.label, making, made.content, made.record, draws, leads=picture.leads)


def command(run: Run, picture: Picture, draws: Sequence[Record]) -> str:
    """The command that makes a picture: by the figure's name where that makes it, else of the artefacts it draws."""
    task, name = picture.task, picture.task.settings.figure
    kind = FIGURES[name]
    words = ["koop", "plot", name]

    def drawn(experiment: Experiment, sources: Sequence[Task] = ()) -> list[Task]:
        chosen = sources or figure_tasks.artefacts(name, experiment)
        return [figure_tasks.figure(name, chosen, task.settings.format, experiment)]

    try:
        (alone,) = drawn(run.experiment)
    except (UsageError, InvalidValueError):  # changes that hold for this method's samples and not for the figure's
        alone = None
    told = list(run.changes)
    if alone != task:
        words += [record.name for record in draws]
        told = [option for option in told if kind.takes == "predictor" and option.startswith(figure_tasks.TOLD_BESIDE)]
        words += _labels(task, kind)
    if run.base != "paper" and (alone == task or kind.takes == "predictor"):
        words += ["--experiment", run.base]
    sources = [] if alone == task else [source for role, source in task.inputs if role.endswith("/predictor")]
    for option in told:
        ((setting, _),) = flat(parse_set([option]))
        if why_idle(setting, run.experiment, lambda experiment: drawn(experiment, sources), [task]) is None:
            words += ["--set", option]
    return shlex.join([*words, "-o", f"{name}.{task.settings.format}"])


def _labels(task: Task, kind: FigureKind) -> Iterator[str]:
    """What artefacts are called, where that is not what they would be called by their settings."""
    if kind.draws != "beside":
        return
    evaluations = {role: evaluation for role, evaluation in task.inputs if role.endswith("/evaluation")}
    ordered = [evaluations[f"{i}/evaluation"] for i in range(len(evaluations))]
    labels = [entry.label for entry in task.settings.series]
    if labels != names([evaluation.input("predictor") for evaluation in ordered]):
        yield from (word for label in labels for word in ("--label", label))


def provenance(illustration: Illustration) -> Iterator[tuple[str, str]]:
    """Where a picture comes from, as names and texts; nothing of the machine but its versions."""
    assert illustration.record is not None
    about = illustration.record.provenance
    yield "artefact", illustration.record.name
    if illustration.draws:
        yield "draws", ", ".join(record.name for record in illustration.draws)
    yield "made", f"{about['time'].replace('T', ' ')[:16]} UTC in {about['seconds']:.1f} s"
    packages = {name: version for name, version in about["versions"].items() if name != "koopcli"}
    koop = about["versions"].get("koopcli", "?")
    yield "koop", f"{koop} (commit {about['git']})" if about["git"] else koop
    yield "with", ", ".join([f"Python {about['python']}", *(f"{name} {version}" for name, version in packages.items())])
