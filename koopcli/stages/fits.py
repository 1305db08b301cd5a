"""The stages that make predictors. A new method is one file and one line here."""

from __future__ import annotations

from koopcli.stages import baseline, fit_edmd, fit_eigen
from koopcli.stages.base import Outlook, Stage, Task

FITS: dict[str, Stage] = {module.STAGE.name: module.STAGE for module in (fit_edmd, fit_eigen, baseline)}

LIFTED = tuple(name for name in FITS if name != baseline.STAGE.name)  # of predictors with lifted states


def outlook(predictor: Task) -> Outlook:
    """What the predictor of a task will be."""
    predicts = FITS[predictor.stage].predicts
    assert predicts is not None
    return predicts(predictor)
