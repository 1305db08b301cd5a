"""How well a predictor does on a log: errors of every state over time, beside hold and DMD with control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.scores import metrics
from koopcli.koopman.selection.blocks import pieces_of
from koopcli.koopman.selection.windows import HORIZONS, OUTER, Windows, ahead_of, nearest, rmse
from koopcli.progress import Progress, silent
from koopcli.records import Array, Channels, Episodes, FloatArray, IndexArray, Meta, Packed

HOLD, DMDC, OWN = "hold", "dmdc", "predictor"
LEVELS = (0.1, 0.5, 0.9)  # quantiles of errors
TOGETHER = 2048  # windows predicted at once


@dataclass(frozen=True, eq=False, repr=False)
class Score(Content):
    """Errors on the windows of a log, each of which starts from its own history.

    ``starts`` (windows,): the rows that they start from; ``errors`` (models, steps, n_x): RMSE of each of ``MODELS`` at
    every step; ``quantiles`` (levels, steps, n_x): of truth minus prediction at ``LEVELS``; ``rmse`` (windows,): the
    paper's measure in percent; ``outside_share``: of windows that start outside the training box; ``limited_share``: of
    inputs that were limited; ``own``: whether the predictor was fitted to this very log.
    """

    starts: IndexArray
    errors: FloatArray
    quantiles: FloatArray
    rmse: FloatArray
    outside_share: float
    limited_share: float
    own: bool
    dt: float
    state_channels: Channels

    MODELS = (OWN, HOLD, DMDC)

    def __repr__(self) -> str:
        return f"Score: {len(self.starts)} windows of {self.errors.shape[1] * self.dt:g} s, {self.state_channels}"

    def figures(self) -> Meta:
        """The numbers that scripts read (`--json`)."""
        steps = [nearest(time, self.dt) - 1 for time in HORIZONS]
        own, hold, dmdc = self.errors[:, steps]
        per_state = {
            name: {
                f"{time:g}": {
                    "rmse": float(own[h, i]),
                    "to_hold": _ratio(own[h, i], hold[h, i]),
                    "to_dmdc": _ratio(own[h, i], dmdc[h, i]),
                }
                for h, time in enumerate(HORIZONS)
            }
            for i, name in enumerate(self.state_channels.names)
        }
        return {
            "windows": len(self.starts),
            "per_state": per_state,
            "rmse": metrics.summary(self.rmse[np.isfinite(self.rmse)]),
            "outside_share": self.outside_share,
            "limited_share": self.limited_share,
            "fitted_to_it": self.own,
        }

    def pack(self) -> Packed:
        """The score for storage."""
        units = self.state_channels.unit_text
        arrays = {
            "starts": Array(self.starts, ("window",), "1"),
            "errors": Array(self.errors, ("model", "step", "state"), units),
            "quantiles": Array(self.quantiles, ("level", "step", "state"), units),
            "rmse": Array(self.rmse, ("window",), "%"),
        }
        facts = {name: getattr(self, name) for name in ("outside_share", "limited_share", "own", "dt")}
        return Packed(arrays, {**facts, "state_channels": self.state_channels.pack()})

    @classmethod
    def unpack(cls, packed: Packed) -> Score:
        """The inverse of :meth:`pack`."""
        meta = dict(packed.meta)
        channels = Channels.unpack(meta.pop("state_channels"))
        return cls(state_channels=channels, **meta, **{name: a.values[...] for name, a in packed.arrays.items()})


def _ratio(above: float, below: float) -> float:
    return float(above / below) if below > 0 else float("nan")


def score(
    predictor: Predictor, dmdc: Predictor, episodes: Episodes, *, own: bool, progress: Progress = silent
) -> Score:
    """The score of a ``predictor`` beside ``dmdc`` on ``episodes``, from windows every 0.3 s, 1 s ahead.

    Raises ``InvalidValueError`` for other states, inputs or periods than the predictor's, and without any window.
    """
    check_alike(predictor, episodes)
    x, u = np.asarray(episodes.x[...], dtype=float), np.asarray(episodes.u[...], dtype=float)
    windows = Windows.of(episodes.dt, predictor.memory * episodes.dt)
    starts = windows.starts(pieces_of(episodes), OUTER)
    if not len(starts):
        raise InvalidValueError(
            f"no episode of this log holds {windows.length:g} s in one piece, a history and what is predicted from it"
        )
    steps = windows.ahead
    models: dict[str, list[FloatArray]] = {OWN: [], HOLD: [], DMDC: []}
    for first in range(0, len(starts), TOGETHER):
        progress(first, len(starts))
        some = starts[first : first + TOGETHER]
        truth = ahead_of(x, some, steps)
        models[HOLD].append(truth - x[some][:, np.newaxis])
        for name, forecaster in ((OWN, predictor), (DMDC, dmdc)):
            models[name].append(truth - forecasts(forecaster, x, u, some, steps)[:, 1:])
    missed = {name: np.concatenate(parts) for name, parts in models.items()}
    truth = ahead_of(x, starts, steps)
    size = np.sqrt((truth**2).sum(axis=(1, 2)))
    with np.errstate(invalid="ignore", divide="ignore"):
        percent = 100 * np.sqrt((missed[OWN] ** 2).sum(axis=(1, 2))) / size
    low, high = predictor.coverage.domain
    return Score(
        starts=starts,
        errors=np.stack([rmse(missed[name]) for name in Score.MODELS]),
        quantiles=np.quantile(missed[OWN], LEVELS, axis=0),
        rmse=percent,
        outside_share=float(((x[starts] < low) | (x[starts] > high)).any(axis=1).mean()),
        limited_share=predictor.limited_share(u),
        own=own,
        dt=episodes.dt,
        state_channels=episodes.state_channels,
    )


def forecasts(predictor: Predictor, x: FloatArray, u: FloatArray, starts: IndexArray, steps: int) -> FloatArray:
    """What a ``predictor`` says of the ``steps`` after each start, from its history: (windows, steps + 1, n_x).

    ``x`` (rows, n_x) and ``u`` (rows, n_u) are those of a log; every start has the predictor's memory before it.
    """
    back = starts[:, np.newaxis] - 1 - np.arange(predictor.memory)
    inputs = u[starts[:, np.newaxis] + np.arange(steps)]
    history = (x[back], u[back]) if predictor.memory else None
    return predictor.predict(x[starts], inputs, history=history)


def check_alike(predictor: Predictor, episodes: Episodes) -> None:
    """Raise ``InvalidValueError`` for episodes of other states, inputs or another period than the predictor's."""
    for what, mine, theirs in (
        ("states", predictor.state_channels, episodes.state_channels),
        ("inputs", predictor.input_channels, episodes.input_channels),
    ):
        if mine != theirs:
            raise InvalidValueError(f"the predictor has the {what} {mine}, the log {theirs}: import it with such a map")
    if abs(predictor.dt - episodes.dt) > 1e-9:
        raise InvalidValueError(
            f"the predictor has steps of {predictor.dt:g} s, the log of {episodes.dt:g} s: import it with that dt"
        )
