"""From a log to tasks: what is fitted to it, chosen on it and said of it."""

from __future__ import annotations

from collections.abc import Sequence

from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.selection.record import Selection
from koopcli.koopman.selection.regress import DMDC
from koopcli.stages.base import Task
from koopcli.stages.predict import Predict
from koopcli.stages.roles import as_inputs
from koopcli.stages.score import OnLog
from koopcli.stages.select import Select, fit_of


def selection(log: Task, settings: Select) -> Task:
    """The choice among the predictors of a ``log``."""
    return Task("select", settings, (("trajectories", log),))


def chosen(log: Task, result: Selection) -> Task:
    """The predictor that was chosen, fitted to the whole ``log``."""
    return fitted(fit_of(result.rungs[result.chosen], result.dt), log)


def fitted(settings: FitEdmd, *logs: Task) -> Task:
    """A predictor of one or several logs."""
    return Task("fit-edmd", settings, as_inputs(logs))


def scored(predictor: Task, log: Task) -> Task:
    """How well a ``predictor`` does on a ``log``, beside DMD with control of the same data."""
    training: Sequence[Task] = [task for role, task in predictor.inputs if role.endswith("trajectories")]
    dmdc = fitted(fit_of(DMDC, 1.0), *training)
    inputs = (("predictor", predictor), ("dmdc", dmdc), ("trajectories", log))
    return Task("score", OnLog(own=log in training), inputs)


def prediction(predictor: Task, settings: Predict, log: Task | None) -> Task:
    """One prediction, from a ``log`` or from a state."""
    inputs = (("predictor", predictor), *([] if log is None else [("trajectories", log)]))
    return Task("predict", settings, tuple(inputs))
