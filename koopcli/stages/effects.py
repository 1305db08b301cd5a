"""Which changes have an effect on what is made: one that has none is refused rather than ignored."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from koopcli.choices import taken, written
from koopcli.config.declared import KINDS
from koopcli.config.experiment import Experiment
from koopcli.errors import KoopError
from koopcli.figures.kit.registry import FIGURES
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.base import Task

Plan = Callable[[Experiment], Sequence[Task]]


def why_idle(name: str, experiment: Experiment, plan: Plan, tasks: Sequence[Task]) -> str | None:
    """Why the change ``name`` of the command line has no effect on the ``tasks`` that ``plan`` makes of the experiment.

    It has none where the same tasks are planned without it. None where it has one, where its value is the one that is
    in effect anyway, and for the name of a vehicle, of which another may make the same.
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
    if section in KINDS:
        kinds = {step.settings.kind for step in steps if step.stage == "sample"} & set(KINDS[section])
        given = [(kind, experiment.value(name, kind)) for kind in sorted(kinds) if _has(experiment, name, kind)]
        if any(value == other.value(name, kind) for kind, value in given):
            return True
        made = [written(step.settings) for step in steps if step.stage == "sample"]
        return any(one["kind"] == kind and one.get(key) == value for one in made for kind, value in given)
    value = experiment.value(name)
    last, made = key.rpartition(".")[2], [written(step.settings) for step in steps if step.stage == section]
    return value == other.value(name) or (bool(made) and all(last in one and one[last] == value for one in made))


def _has(experiment: Experiment, name: str, kind: str) -> bool:
    try:
        experiment.value(name, kind)
    except KoopError:
        return False
    return True


def _reason(name: str, tasks: Sequence[Task], steps: Sequence[Task]) -> str:
    """Why nothing depends on a setting, in words."""
    section, _, key = name.partition(".")
    samples, plants = _samples(section, steps), [step.settings.plant.kind for step in steps if step.stage == "simulate"]
    used = {step.stage for step in steps} - {"plot", "sample"} | ({"sample", "test"} if samples else set())
    used |= {"vehicle", "simulate"} if plants or any(taken(type(sample)) for sample in samples) else set()
    figure = tasks[0].settings.figure if tasks[0].stage == "plot" else ""
    if unused := _unused_kind(section, key, samples):
        return unused
    instead = f": {FIGURES[figure].instead}" if figure and FIGURES[figure].instead else ""
    if section not in used:
        return _not_behind(section, figure, samples) + instead
    if section in KINDS and "none" in {getattr(sample, "excitation", "") for sample in samples}:
        return "the excitation 'none' has no use for it"
    plants += [sample.meant_for.kind for sample in samples if hasattr(sample, "vehicle")]
    if section in ("vehicle", "simulate") and plants:
        return f"the plant '{plants[0]}' has no use for it"
    if section == "vehicle":
        names = " and ".join(taken(type(samples[0])))
        return f"a sample of kind '{samples[0].kind}' takes {names} of the vehicle alone"
    return f"the figure '{figure}' draws nothing of it{instead}" if figure else "the same is made without it"


def _unused_kind(section: str, key: str, samples: Sequence[SampleChoice]) -> str:
    """What is said of a setting in the table of a kind that is not in effect; nothing of others."""
    *choice, kind, _ = ["", "", *key.split(".")]
    if section in KINDS and kind and kind not in {sample.kind for sample in samples}:
        return f"no {section} of kind '{kind}' is used"
    return f"the {choice[-1]} is not '{kind}'" if section not in (*KINDS, "vehicle") and choice[-1] else ""


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
