"""One prediction from a log or from a given state, beside what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.selection.score import check_alike, forecasts
from koopcli.records import Array, Channels, Episodes, FloatArray, Meta, Packed

SCORED = 1.0  # s: what a selection judges


@dataclass(frozen=True, eq=False, repr=False)
class Forecast(Content):
    """Predicted states ``x`` (steps + 1, n_x) under ``u`` (steps, n_u), from the time ``start`` in s.

    ``measured`` (steps + 1, n_x): what a log says of the same time, not a number where it says nothing;
    ``limited_share``: of inputs that were limited; ``history``: whether the past was known; ``display``: the unit that
    each state and input is written in, by name, and ``factors`` what one of it is in SI.
    """

    x: FloatArray
    measured: FloatArray
    u: FloatArray
    start: float
    dt: float
    limited_share: float
    history: bool
    state_channels: Channels
    input_channels: Channels
    display: Mapping[str, str]
    factors: Mapping[str, float]

    def __repr__(self) -> str:
        return f"Forecast: {len(self.u)} steps of {self.dt:g} s from {self.start:g} s, states {self.state_channels}"

    def figures(self) -> Meta:
        """The numbers that scripts read (`--json`)."""
        known = np.isfinite(self.measured).all(axis=1)
        missed = np.sqrt(((self.x - self.measured)[known][1:] ** 2).mean(axis=0)) if known.sum() > 1 else None
        names = self.state_channels.names
        return {
            "steps": len(self.u),
            "start": self.start,
            "history": self.history,
            "limited_share": self.limited_share,
            "last": dict(zip(names, self.x[-1].tolist(), strict=True)),
            "rmse": None if missed is None else dict(zip(names, missed.tolist(), strict=True)),
        }

    def table(self) -> tuple[list[str], list[list[Any]]]:
        """Time, predicted and measured states and inputs, in the units of the map."""
        columns: dict[str, Any] = {"time (s)": self.start + self.dt * np.arange(len(self.x))}
        inputs = np.vstack([self.u, np.full((1, self.u.shape[1]), np.nan)])
        parts = (("predicted", self.state_channels, self.x), ("measured", self.state_channels, self.measured))
        for what, channels, values in (*parts, ("", self.input_channels, inputs)):
            for name, unit, column in zip(channels.names, channels.units, values.T, strict=True):
                shown, factor = self.display.get(name, unit), self.factors.get(name, 1.0)
                columns[f"{name}{f' {what}' if what else ''} ({shown})"] = column / factor
        rows = np.stack(list(columns.values()), axis=1).tolist()
        return list(columns), [["" if np.isnan(value) else value for value in row] for row in rows]

    def pack(self) -> Packed:
        """The forecast for storage."""
        units = self.state_channels.unit_text
        arrays = {
            "x": Array(self.x, ("sample", "state"), units),
            "measured": Array(self.measured, ("sample", "state"), units),
            "u": Array(self.u, ("step", "input"), self.input_channels.unit_text),
        }
        facts = {name: getattr(self, name) for name in ("start", "dt", "limited_share", "history")}
        told = {"display": dict(self.display), "factors": dict(self.factors)}
        channels = {"state_channels": self.state_channels.pack(), "input_channels": self.input_channels.pack()}
        return Packed(arrays, {**facts, **told, **channels})

    @classmethod
    def unpack(cls, packed: Packed) -> Forecast:
        """The inverse of :meth:`pack`."""
        meta: Meta = dict(packed.meta)
        meta |= {name: Channels.unpack(meta[name]) for name in ("state_channels", "input_channels")}
        return cls(**meta, **{name: array.values[...] for name, array in packed.arrays.items()})


def from_log(
    predictor: Predictor,
    episodes: Episodes,
    at: float,
    steps: int,
    run: int = 0,
    display: Mapping[str, str] | None = None,
    factors: Mapping[str, float] | None = None,
) -> Forecast:
    """The prediction from the row of a log ``at`` so many s after the start of a ``run``, with its history and inputs.

    Raises ``InvalidValueError`` for a time without a row, and where an episode is too short before or after it.
    """
    check_alike(predictor, episodes)
    row, first, last = _row_at(episodes, at, run)
    if row - first < predictor.memory:
        raise InvalidValueError(
            f"the log has {(row - first) * episodes.dt:g} s in one piece before {at:g} s, the predictor starts from "
            f"{predictor.memory * episodes.dt:g} s of history: start later"
        )
    if row + steps > last:
        raise InvalidValueError(
            f"the log goes on for {(last - row) * episodes.dt:g} s in one piece after {at:g} s, not for "
            f"{steps * episodes.dt:g} s: predict for less with --seconds"
        )
    low = row - predictor.memory
    x, u = (np.asarray(values[low : row + steps + 1], dtype=float) for values in (episodes.x, episodes.u))
    start = np.array([predictor.memory])
    inputs = u[predictor.memory : predictor.memory + steps]
    return Forecast(
        x=forecasts(predictor, x, u, start, steps)[0],
        measured=x[predictor.memory :],
        u=inputs,
        start=float(episodes.time[row] - _origin(episodes, run)),
        dt=episodes.dt,
        limited_share=predictor.limited_share(inputs),
        history=True,
        state_channels=episodes.state_channels,
        input_channels=episodes.input_channels,
        display=display or {},
        factors=factors or {},
    )


def from_state(
    predictor: Predictor,
    x0: FloatArray,
    u: FloatArray,
    display: Mapping[str, str] | None = None,
    factors: Mapping[str, float] | None = None,
) -> Forecast:
    """The prediction from ``x0`` (n_x,) under ``u`` (steps, n_u), as if it had stood so before."""
    x = predictor.predict(x0, u)
    return Forecast(
        x=x,
        measured=np.full(x.shape, np.nan),
        u=u,
        start=0.0,
        dt=predictor.dt,
        limited_share=predictor.limited_share(u),
        history=not predictor.needs_history,
        state_channels=predictor.state_channels,
        input_channels=predictor.input_channels,
        display=display or {},
        factors=factors or {},
    )


def _origin(episodes: Episodes, run: int) -> float:
    """The time in s of the first row of a ``run``."""
    mine = episodes.starts[episodes.runs == run]
    if not len(mine):
        raise InvalidValueError(f"the log has the runs 0 to {int(episodes.runs.max())}, not {run}")
    return float(mine.min())


def _row_at(episodes: Episodes, at: float, run: int) -> tuple[int, int, int]:
    """The row nearest the time ``at`` after the start of a ``run``, with the first and the last one of its episode."""
    begins = episodes.starts - _origin(episodes, run)
    ends = begins + episodes.dt * (episodes.lengths - 1)
    half = episodes.dt / 2
    inside = np.flatnonzero((episodes.runs == run) & (begins - half <= at) & (at <= ends + half))
    if not len(inside):
        mine = np.flatnonzero(episodes.runs == run)
        spans = ", ".join(f"{begins[i]:.2f} to {ends[i]:.2f}" for i in mine[:3])
        more = f" and {len(mine) - 3} more" if len(mine) > 3 else ""
        raise InvalidValueError(f"the log has no row at {at:g} s; its episodes last from {spans} s{more}")
    i = int(inside[0])
    first, last = int(episodes.bounds[i]), int(episodes.bounds[i + 1]) - 1
    return min(first + max(0, round((at - begins[i]) / episodes.dt)), last), first, last
