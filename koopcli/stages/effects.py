"""Which changes have an effect on what is made: one that has none is refused rather than ignored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, get_args

from koopcli.choices import Choice, taken, written
from koopcli.config.declared import KINDS, is_choice
from koopcli.config.experiment import Experiment
from koopcli.config.settings import FitName
from koopcli.errors import KoopError
from koopcli.figures.kit.registry import FIGURES
from koopcli.koopman.predictor.dynamics.force_driven import STRETCHES
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.asked import forces_of
from koopcli.stages.base import Task

Plan = Callable[[Experiment], Sequence[Task]]
FORCED = ("evaluate.input_matrix", "evaluate.every")  # how a predictor with force inputs is asked


def why_idle(name: str, experiment: Experiment, plan: Plan, tasks: Sequence[Task]) -> str | None:
    """Why the change ``name`` of the command line has no effect on the ``tasks`` that ``plan`` makes of the experiment.

    It has none where the same tasks are planned without it. Returns None if it has one, if its value is in effect
    anyway, or if it names a vehicle, since two vehicles may make the same.
    """
    if name == "vehicle.name":
        return None
    try:
        other = experiment.without(name)
        if list(plan(other)) != list(tasks):
            return None
    except KoopError:
        return None
    steps = list(dict.fromkeys(step for task in tasks for step in task.upstream()))
    return None if _in_effect(name, experiment, other, steps) else _reason(name, tasks, steps)


def _in_effect(name: str, experiment: Experiment, other: Experiment, steps: Sequence[Task]) -> bool:
    """Whether the value of the change is that of the experiment without it, or of what is made."""
    section, _, key = name.partition(".")
    raw = experiment.given(name)
    if section == "vehicle":
        return experiment.vehicle == other.vehicle
    if name == "experiment.fit":
        return {step.stage for step in steps} & set(get_args(FitName)) == {raw}
    if section in KINDS:
        used = _samples(section, steps)
        unchanged = list(_unchanged(other, section, used))
    else:
        used, unchanged = [step.settings for step in steps if step.stage == section], [other.settings(section)]
    made = [value for settings in used for value in _values(settings, key)]
    return any(_is(raw, value) for settings in unchanged for value in _values(settings, key)) or (
        bool(made) and all(_is(raw, value) for value in made)
    )


def _unchanged(other: Experiment, section: str, used: Sequence[SampleChoice]) -> Iterator[SampleChoice]:
    """Samples of the kinds that are ``used``, as another experiment has them."""
    for sample in used:
        if sample.kind in KINDS[section]:
            with suppress(KoopError):
                yield other.sampled(section, sample.kind)


def _values(settings: Any, key: str) -> list[object]:
    """The value of a setting, by its name or in the table of a kind; none where the kind is another."""
    *path, name = [*(["kind"] if isinstance(settings, Choice) and "." in key else []), *key.split(".")]
    values = written(settings)
    kinds = dict(zip(path[::2], path[1::2], strict=True))
    return [values[name]] if name in values and kinds.items() <= values.items() else []


def _is(raw: object, value: object) -> bool:
    """Whether a ``raw`` value stands for the ``value`` of a setting."""
    return value in (tuple(raw) if isinstance(raw, list) else raw, (raw,))


def _reason(name: str, tasks: Sequence[Task], steps: Sequence[Task]) -> str:
    """Why nothing depends on a setting, in words."""
    section, _, key = name.partition(".")
    samples, plants = _samples(section, steps), [step.settings.plant.kind for step in steps if step.stage == "simulate"]
    used = {step.stage for step in steps} - {"plot", "sample"} | ({"sample", "test"} if samples else set())
    used |= {"vehicle", "simulate"} if plants or any(taken(type(sample)) for sample in samples) else set()
    figure = tasks[0].settings.figure if tasks[0].stage == "plot" else ""
    own = samples if section in KINDS else [step.settings for step in steps if step.stage == section]
    if of_choice := _unused_kind(section, key, own) or _chosen(section, key, own) or _unforced(name, tasks):
        return of_choice
    instead = f": {FIGURES[figure].instead}" if figure and FIGURES[figure].instead else ""
    if section not in used:
        return _not_behind(section, figure, samples) + instead
    if section in KINDS and "none" in {getattr(sample, "excitation", "") for sample in samples}:
        return "the excitation 'none' has no use for it"
    plants += [sample.meant_for.kind for sample in samples if hasattr(sample, "vehicle")]
    if section in ("vehicle", "simulate") and plants:
        noise = "there is no noise without simulate.noise"
        return noise if key.startswith("noise_") else f"the plant '{plants[0]}' has no use for it"
    if section == "vehicle":
        names = " and ".join(taken(type(samples[0])))
        return f"a sample of kind '{samples[0].kind}' takes {names} of the vehicle alone"
    return f"the figure '{figure}' draws nothing of it{instead}" if figure else "the same is made without it"


def _unforced(name: str, tasks: Sequence[Task]) -> str:
    """Why an evaluation has no use for how a predictor with force inputs is asked; nothing of other settings."""
    scored = [step.input("predictor") for task in tasks for step in task.upstream() if step.stage == "evaluate"]
    if name not in FORCED or not scored:
        return ""
    if not any(forces_of(predictor) for predictor in scored):
        return "the predictor has no force inputs: fit with fit-eigen.inputs=forces"
    return f"only an input matrix of {' or '.join(STRETCHES)} has a use for it"


def _unused_kind(section: str, key: str, used: Sequence[Any]) -> str:
    """What is said of a setting in the table of a kind that none of the settings ``used`` has; nothing of others."""
    *choice, kind, _ = ["", "", *key.split(".")]
    if section == "vehicle" or not kind or any(_values(settings, key) for settings in used):
        return ""
    return f"no {section} of kind '{kind}' is used" if section in KINDS else f"the {choice[-1]} is not '{kind}'"


def _chosen(section: str, key: str, used: Sequence[Any]) -> str:
    """What is said of a choice that is made otherwise; nothing of other settings."""
    name = key.rpartition(".")[2]
    made = [value for settings in used for value in _values(settings, key)]
    return f"the {name} is '{made[0]}' in any case" if section != "vehicle" and made and is_choice(name) else ""


def _samples(section: str, steps: Sequence[Task]) -> list[SampleChoice]:
    """The settings of the samples behind ``steps``, of a section of samples those alone that are its own."""
    every = [step for step in steps if step.stage == "sample"]
    tests = [task for step in steps if step.stage in ("evaluate", "plot") for role, task in step.inputs if _tests(role)]
    tested = {sample for test in tests for sample in test.upstream() if sample.stage == "sample"}
    own = {"test": [step for step in every if step in tested], "sample": [step for step in every if step not in tested]}
    return [step.settings for step in own.get(section) or (every if section != "test" else [])]


def _tests(role: str) -> bool:
    return role.rpartition("/")[2] == "trajectories"


def _not_behind(section: str, figure: str, samples: Sequence[SampleChoice]) -> str:
    """Why a setting of another stage than those that are behind a task changes nothing."""
    if figure:
        return f"the figure '{figure}' draws nothing of it"
    if section == "vehicle" and samples:
        return f"a sample of kind '{samples[0].kind}' does not depend on the vehicle"
    return "the fit is named" if section == "experiment" else "nothing is made by it"
