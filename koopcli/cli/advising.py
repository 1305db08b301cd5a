"""What to type where a score does not beat a baseline: a command that runs as printed, with the user's own options."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from koopcli.cli.invocation import Invocation
from koopcli.config.changes import Changes, parse_set
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.config.grids import text_of
from koopcli.errors import KoopError

if TYPE_CHECKING:
    import typer

    from koopcli.records import Meta
    from koopcli.stages.advice import Better
    from koopcli.stages.base import Task

TEST = ("test", "evaluate")  # sections of what a predictor is scored on, which it does not depend on
OUTPUTS = ("as_json", "dry_run")  # options that say what to print
PAPER = "paper"


def advice(typed: Typed, call: Invocation, evaluation: Task, figures: Meta) -> str | None:
    """Why the predictor of an ``evaluation`` does not beat its baselines, and what to type; None for a baseline."""
    from koopcli.stages.advice import advise, case_of

    case = case_of(evaluation, figures)
    if case is None:
        return None
    advice = advise(case)
    if advice.own_test:
        return (
            f"{advice.why}. Try: {_line(['koop', 'evaluate', *typed.only('predictor'), *typed.but('predictor', 'on')])}"
        )
    if not advice.page:
        return f"{advice.why}."
    if advice.better is None:
        return f"{advice.why}. No setting of koop is known to beat the baseline here: see {advice.page}"
    command = _short(typed, call, evaluation, advice.better) or _nested(typed, call, evaluation, advice.better)
    if command is None:
        return f"{advice.why}; see {advice.page} for what does better"
    gain = advice.better.gain
    measured = f"measured on {gain.vehicle} to turn {gain.before:.3g} % into {gain.after:.3g} %"
    return f"{advice.why}. Try this, {measured}: {command}"


@dataclass(frozen=True)
class Typed:
    """The options of a command line by the names of their parameters, each with the words that it was typed with."""

    words: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, context: typer.Context) -> Typed:
        """What was typed of the command that runs, but for what says what to print."""
        words = {}
        for parameter in context.command.params:
            name = str(parameter.name)
            value = context.params.get(name)
            if name not in OUTPUTS and value not in (None, False, [], (), parameter.default):
                option = [] if parameter.param_type_name == "argument" else parameter.opts[:1]
                values = value if isinstance(value, (list, tuple)) else [value]
                words[name] = tuple(word for item in values for word in (*option, str(item)))
        return cls(words)

    @property
    def experiment(self) -> str:
        """The name or file of the experiment."""
        return self.words.get("experiment", (PAPER,))[-1]

    @property
    def sets(self) -> dict[str, str]:
        """The settings that were changed, by their full names."""
        pairs = (text.partition("=") for text in self.words.get("set_", ())[1::2])
        vehicle = {"vehicle.name": self.words["vehicle"][-1]} if "vehicle" in self.words else {}
        return {name.strip(): value for name, _, value in pairs} | vehicle

    def only(self, *names: str) -> list[str]:
        """The options ``names``."""
        return [word for name in names for word in self.words.get(name, ())]

    def but(self, *names: str) -> list[str]:
        """All options but ``names``."""
        return self.only(*(name for name in self.words if name not in names))


def _short(typed: Typed, call: Invocation, evaluation: Task, better: Better) -> str | None:
    """The command line itself with another experiment, where that is all it takes; None where it is not."""
    from koopcli.stages import recipes
    from koopcli.stages.effects import why_idle

    if typed.experiment != PAPER or "predictor" in typed.words:
        return None
    sets = {name: value for name, value in typed.sets.items() if _stays(name, better)}
    sets |= {f"sample.{name}": text_of(value) for name, value in better.sample.items()}
    sets |= {f"{better.fit}.{name}": text_of(value) for name, value in better.changes.items()}
    try:
        tested = {section: values for section, values in call.changes.items() if section in TEST}  # by options too
        experiment = load_experiment(better.experiment, {**_changes(sets), **tested})
        test = evaluation.input("trajectories") if "on" in typed.words else None

        def plan(experiment: Experiment) -> list[Task]:
            return [recipes.evaluation(experiment, recipes.predictor(experiment), test)]

        (task,) = plan(experiment)
        fit = task.input("predictor")
        idle = any(why_idle(name, experiment, plan, [task]) for name in sets)
    except KoopError:
        return None
    if idle or task.input("trajectories") != evaluation.input("trajectories"):
        return None
    if not _does(fit, call, evaluation, better):
        return None
    rest = typed.but("experiment", "vehicle", "set_")
    return _line(["koop", "evaluate", *_options(better.experiment, sets), *rest])


def _nested(typed: Typed, call: Invocation, evaluation: Task, better: Better) -> str | None:
    """The command line with another predictor, made by a command inside it; None where its settings cannot be said."""
    from koopcli.config.words import plant_words, sample_words, vehicle_words
    from koopcli.stages import recipes
    from koopcli.stages.roles import roles_of

    inputs = dict(evaluation.input("predictor").inputs)
    data = [inputs[role] for role in roles_of(inputs)]
    changes = {f"{better.fit}.{name}": text_of(value) for name, value in better.changes.items()}
    names: list[str] = []
    if better.data == "same":
        records = [call.pipeline.found(task) for task in data]
        names = [record.name for record in records if record is not None]
        fit = recipes.fit_edmd(load_experiment(better.experiment, _changes(changes)), *data)
        if len(names) < len(data):
            return None
    else:
        simulation, sample = data[0].settings, data[0].ancestor("sample").settings
        vehicle = vehicle_words(simulation.vehicle, simulation.plant)
        if vehicle is None:
            return None
        kept = sample_words(sample, better.keeps) | {f"sample.{k}": text_of(v) for k, v in better.sample.items()}
        changes = {**vehicle, **plant_words(simulation), **kept, **changes}
        fit = recipes.METHODS[better.fit](load_experiment(better.experiment, _changes(changes)))
    if not _does(fit, call, evaluation, better):
        return None
    inner = _line(["koop", better.fit, *names, *_options(better.experiment, changes), *typed.only("store")])
    tested = {name: value for name, value in typed.sets.items() if name.partition(".")[0] in TEST}
    rest = [*_options(typed.experiment, tested), *typed.but("predictor", "experiment", "vehicle", "set_")]
    return " ".join([f'koop evaluate "$({inner})"', *([_line(rest)] if rest else [])])


def _stays(name: str, better: Better) -> bool:
    """Whether a setting that was typed is one of the better predictor's data or of its test, and not its own."""
    section, _, key = name.partition(".")
    if section == "sample":
        last = key.rpartition(".")[2]
        return last not in better.sample and (better.data == "same" or last in better.keeps)
    return section in ("vehicle", "simulate", *TEST)


def _does(fit: Task, call: Invocation, evaluation: Task, better: Better) -> bool:
    """Whether a predictor can be made and scored, is of the plant and vehicle at hand, and covers states as fast."""
    from koopcli.stages import recipes

    simulation = next(task for task in evaluation.input("predictor").upstream() if task.stage == "simulate")
    mine, theirs = (task.ancestor("simulate") for task in (fit, simulation))
    for name in ("plant", "vehicle", "dt"):
        if getattr(mine.settings, name) != getattr(theirs.settings, name):
            return False
    samples = [task.ancestor("sample").settings for task in (mine, theirs)]
    if any(getattr(samples[0], name, None) != getattr(samples[1], name, None) for name in better.keeps):
        return False
    try:
        call.pipeline.check(recipes.evaluation(call.experiment, fit, evaluation.input("trajectories")))
    except KoopError:
        return False
    return True


def _changes(sets: Mapping[str, str]) -> Changes:
    return parse_set([f"{name}={value}" for name, value in sets.items()])


def _options(experiment: str, sets: Mapping[str, str]) -> list[str]:
    """An experiment and changes of it as options."""
    words = [] if experiment == PAPER else ["--experiment", experiment]
    for name, value in sets.items():
        words += ["--vehicle", value] if name == "vehicle.name" else ["--set", f"{name}={value}"]
    return words


def _line(words: Sequence[str]) -> str:
    return shlex.join(words)
