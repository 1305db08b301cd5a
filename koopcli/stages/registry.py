"""The stages by name."""

from __future__ import annotations

from koopcli.stages import evaluate, plot, sample, simulate, sweep
from koopcli.stages.base import Stage
from koopcli.stages.fits import FITS

STAGES: dict[str, Stage] = {
    stage.name: stage
    for stage in (sample.STAGE, simulate.STAGE, *FITS.values(), evaluate.STAGE, sweep.STAGE, plot.STAGE)
}
