"""The stages by name."""

from __future__ import annotations

from koopcli.stages import control, evaluate, logs, plot, predict, sample, score, select, simulate, sweep
from koopcli.stages.base import Stage
from koopcli.stages.fits import FITS

STAGES: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        *(sample.STAGE, simulate.STAGE, logs.STAGE, *FITS.values()),
        *(evaluate.STAGE, select.STAGE, score.STAGE, predict.STAGE, control.STAGE, sweep.STAGE, plot.STAGE),
    )
}
