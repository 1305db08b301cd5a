"""What a predictor's scores are worth, beside baselines without any fit and the linear predictor of its data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from koopcli.config.experiment import Experiment
from koopcli.config.settings import Baseline
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.records import Meta
from koopcli.stages import recipes
from koopcli.stages.asked import in_force
from koopcli.stages.base import Task
from koopcli.stages.fit_edmd import OF_ONE_RUN
from koopcli.stages.fits import LIFTED
from koopcli.stages.lineage import lineage
from koopcli.stages.recorded import all_settings
from koopcli.stages.roles import roles_of
from koopcli.store import Record, Store

LINEAR = FitEdmd.of(basis="total", order=1)
USELESS = 50.0  # percent of a trajectory's size
NAMES = {
    "hold": "hold the first state",
    "linearisation": "linearisation at the first state",
    "linear": "linear predictor",
}


def beside(experiment: Experiment, evaluation: Task) -> dict[str, Task]:
    """Evaluations of what a predictor has to beat, on the same test set; none where its training data are gone."""
    predictor = evaluation.input("predictor")
    inputs = dict(predictor.inputs)
    data = [inputs[role] for role in roles_of(inputs)]
    if not data:
        return {}
    others = {
        "hold": recipes.baseline(replace(experiment, baseline=Baseline("hold")), data[0]),
        "linearisation": recipes.baseline(replace(experiment, baseline=Baseline("linearisation")), data[0]),
        "linear": recipes.fit_edmd(replace(experiment, fit_edmd=LINEAR), *data),
    }
    asked, trajectories = evaluation.settings, evaluation.input("trajectories")
    return {
        name: Task("evaluate", in_force(asked, task), (("predictor", task), ("trajectories", trajectories)))
        for name, task in others.items()
        if (task.stage, task.settings) != (predictor.stage, predictor.settings)
    }


def fitted_to_test_data(evaluation: Record, store: Store) -> bool:
    """Whether a predictor was fitted to what it is tested on, by whatever name: the same data, or the beginning of
    trajectories that one sample gives.
    """
    behind = {ancestor.role: ancestor for ancestor in lineage(evaluation, store).inputs}
    predictor, test = behind["predictor"], behind["trajectories"].record
    if predictor.record is None or predictor.record.stage not in LIFTED:
        return False
    data = predictor.record.recipe["inputs"]
    roles = roles_of(data)
    if evaluation.recipe["inputs"]["trajectories"] in [data[role] for role in roles]:
        return True
    fitted = [
        ancestor.record for ancestor in predictor.inputs if ancestor.role in roles and ancestor.record is not None
    ]
    return test is not None and any(_begins(test, whole) for whole in fitted)


def _begins(part: Record, whole: Record) -> bool:
    """Whether trajectories are the first steps of others, or all of them."""
    of_part, of_whole = all_settings(part), all_settings(whole)
    same = all(of_part.get(name) == value for name, value in of_whole.items() if name not in OF_ONE_RUN)
    return same and part.recipe["inputs"] == whole.recipe["inputs"] and of_part["steps"] <= of_whole["steps"]


@dataclass(frozen=True)
class Verdict:
    """Whether a predictor ``beats`` all baselines by the mean RMSE, and that in words."""

    beats: bool
    text: str


def verdict(figures: Meta, others: Mapping[str, Meta]) -> Verdict:
    """The plain verdict on the ``figures`` of an evaluation beside those of ``others``."""
    mean = _mean(figures)
    better = [name for name, scores in others.items() if not mean < _mean(scores)]
    if figures["diverged"]:
        return Verdict(False, f"the predictor cannot be trusted: {figures['diverged']} of its predictions diverge")
    if better:
        named = " or ".join(f"the baseline '{NAMES[name]}' ({_mean(others[name]):.4g} %)" for name in better)
        return Verdict(False, f"the predictor, with {mean:.4g} %, does not beat {named}")
    nearest = min(others, key=lambda name: _mean(others[name]))
    best = f"'{NAMES[nearest]}' has {_mean(others[nearest]):.4g} %"
    caveat = f"; an error of {mean:.2g} % is of little use all the same" if mean > USELESS else ""
    return Verdict(True, f"the predictor, with {mean:.4g} %, beats every baseline: {best}{caveat}")


def _mean(figures: Meta) -> float:
    """The mean error, which nothing finite undercuts where none is defined."""
    mean = float(figures["rmse"]["mean"])
    return math.inf if math.isnan(mean) else mean
