"""Which settings have an effect on what is made: one that has none is refused rather than ignored."""

from __future__ import annotations

from collections.abc import Sequence

from koopcli.config.driving import MAGNITUDES
from koopcli.config.experiment import Experiment
from koopcli.config.plants import UNUSED
from koopcli.config.samples import ELSEWHERE, OF_VEHICLE, SAMPLED_FOR
from koopcli.stages.base import Task


def why_idle(name: str, experiment: Experiment, tasks: Sequence[Task], reads: Sequence[str] = ()) -> str | None:
    """Why the setting ``name`` has no effect on any of ``tasks``, or None where it has one.

    ``reads``: settings, or sections of them, that have one whatever the stages use.
    """
    if any(f"{name}.".startswith(f"{one}.") for one in reads):
        return None
    section, _, key = name.partition(".")
    behind = [step for task in tasks for step in task.upstream()]
    if section in ("sample", "test"):
        return _idle_sample(section, key, tasks, behind)
    stages = {step.stage for step in behind}
    if ELSEWHERE.get(key) == section and any(hasattr(step.settings, key) for step in behind if step.stage == "sample"):
        return None
    if tasks and section != "vehicle" and section not in stages - {"plot"}:  # a figure reads what it is told of
        return _of_nothing(tasks, "the fit is named" if section == "experiment" else "nothing is made by it")
    if section in ("vehicle", "simulate"):
        return _idle_in_plants(name, key, tasks, behind)
    return _idle_in_fit(section, key, experiment)


def _of_nothing(tasks: Sequence[Task], otherwise: str = "nothing is made by it") -> str:
    drawn = tasks[0].stage == "plot"
    return f"the figure '{tasks[0].settings.figure}' draws nothing of it" if drawn else otherwise


def _idle_sample(section: str, key: str, tasks: Sequence[Task], behind: Sequence[Task]) -> str | None:
    """Of a setting of samples, of one kind or of the kind in use, which only evaluations have."""
    tested = _test_samples(behind, ("evaluate", "plot"))
    relevant = tested if section == "test" else _samples(behind) - tested or tested
    driven = {getattr(one.settings, "excitation", None) for one in relevant}
    if key.rpartition(".")[2] in ("amplitude", *MAGNITUDES) and driven == {"none"}:
        return "the excitation 'none' has no use for it"
    if "." not in key:
        in_use = _test_samples(behind, ("evaluate",)) if section == "test" else relevant
        return _of_nothing(tasks) if tasks and not in_use else None
    kind = key.partition(".")[0]
    return None if kind in {one.settings.kind for one in relevant} else f"no {section} of kind '{kind}' is used"


def _idle_in_plants(name: str, key: str, tasks: Sequence[Task], behind: Sequence[Task]) -> str | None:
    """Of a setting of the vehicle or of its simulation."""
    plants = {step.settings.plant for step in behind if step.stage == "simulate"}
    samples = [step.settings for step in behind if step.stage == "sample"]
    plants |= {SAMPLED_FOR[one.kind] for one in samples if hasattr(one, "vehicle")}
    own = OF_VEHICLE if key == "name" else (key,) if key in OF_VEHICLE else ()
    if not plants and not any(hasattr(one, name) for one in samples for name in own):
        if tasks and tasks[0].stage == "plot":
            return _of_nothing(tasks)
        if key == "name":  # another vehicle may make the same, and that is said instead
            return None
        return "only samples by kinetic energy depend on the vehicle, through its m and Jzz, and those on wheels (r_w)"
    unused = [plant for plant in plants if any(f"{name}.".startswith(f"{one}.") for one in UNUSED[plant])]
    return f"the plant '{unused[0]}' has no use for it" if plants and len(unused) == len(plants) else None


def _idle_in_fit(section: str, key: str, experiment: Experiment) -> str | None:
    """Of a setting of a fit that another one switches off."""
    if section == "fit-edmd":
        fit, chosen = experiment.fit_edmd, "basis"
        idle = getattr(fit.settled(), key) != getattr(fit, key)
        return f"{section}.{chosen} '{fit.basis}' has no use for it" if idle else None
    if section == "fit-eigen" and key in (off := experiment.fit_eigen.idle()):
        return f"{section}.{off[key]} '{getattr(experiment.fit_eigen, off[key])}' has no use for it"
    return None


def _samples(behind: Sequence[Task]) -> set[Task]:
    return {step for step in behind if step.stage == "sample"}


def _test_samples(behind: Sequence[Task], stages: Sequence[str]) -> set[Task]:
    """The samples that steps of ``stages`` among ``behind`` test on."""
    tests = [
        task
        for step in behind
        if step.stage in stages
        for role, task in step.inputs
        if role.rpartition("/")[2] == "trajectories"
    ]
    return {sample for test in tests for sample in _samples(list(test.upstream()))}
