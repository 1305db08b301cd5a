"""The stages by name."""

from __future__ import annotations

from koopcli.stages import evaluate, fit_edmd, plot, sample, simulate
from koopcli.stages.base import Stage

STAGES: dict[str, Stage] = {module.STAGE.name: module.STAGE for module in (sample, simulate, fit_edmd, evaluate, plot)}
