"""Initial states with the errors of their trajectories, drawn as balls: what two figures share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from koopcli.figures.kit.figure import Source, column, state_columns, with_error
from koopcli.koopman.scores.evaluation import Evaluation
from koopcli.records import Array, Channels, FloatArray

LARGEST_SHOWN = 0.98  # quantile of the errors where the colours end


@dataclass(frozen=True)
class Balls:
    """``x0`` (n, n_x) with its ``rmse`` (n,) in percent and ``distance`` (n,) to the data in half-widths of their box,
    the largest errors last; ``top`` is where colours end.
    """

    x0: FloatArray
    rmse: FloatArray
    distance: FloatArray
    top: float
    channels: Channels

    @property
    def sizes(self) -> FloatArray:
        """Areas (n,) in square points: larger where the error is."""
        return np.asarray(1 + 14 * np.clip(self.rmse / self.top, 0, 1))

    @property
    def beyond(self) -> str:
        """How a colour bar ends: pointed where errors are larger than the last colour."""
        return "max" if self.rmse.max() > self.top else "neither"


def balls(source: Source) -> Balls:
    """The initial states of an evaluation. Raises ``InvalidValueError`` where every prediction diverged."""
    evaluation: Evaluation = source.records["evaluation"]
    (shown,) = with_error([source])
    order = np.argsort(evaluation.rmse[shown], kind="stable")
    x0, rmse, distance = (a[shown][order] for a in (evaluation.x0, evaluation.rmse, evaluation.distance))
    top = float(np.quantile(rmse, LARGEST_SHOWN)) or 1.0
    return Balls(x0, rmse, distance, top, evaluation.state_channels)


def columns(shown: Balls) -> Mapping[str, Array]:
    """Every initial state with its error and its distance to the data."""
    return {
        **state_columns(shown.x0, shown.channels, "trajectory", "{}_0"),
        "rmse": column(shown.rmse, "trajectory", "%"),
        "distance": column(shown.distance, "trajectory", "half-widths"),
    }
