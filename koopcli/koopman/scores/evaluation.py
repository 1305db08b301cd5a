"""The scores of a predictor on test trajectories, one row a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.coverage import Coverage
from koopcli.koopman.scores import metrics
from koopcli.progress import Progress, silent, within
from koopcli.records import Array, BoolArray, Channels, FloatArray, IndexArray, Meta, Packed, Trajectories


class Forecaster(Protocol):
    """What can be scored: a predictor of whichever method, or a baseline."""

    @property
    def functions(self) -> int:
        """Dimension of the lifted state."""

    @property
    def knows_inputs(self) -> bool:
        """Whether inputs move the prediction at all."""

    @property
    def dt(self) -> float:
        """Sampling period in s."""

    @property
    def coverage(self) -> Coverage:
        """Where its training states lie."""

    @property
    def state_channels(self) -> Channels:
        """Names and units of x."""

    @property
    def input_channels(self) -> Channels:
        """Names and units of u."""

    def bound(self, x: FloatArray) -> FloatArray | None:
        """What it says the error in percent from ``x`` (n, n_x) stays below, (n,), if it says so at all."""

    def predict(self, x0: FloatArray, u: FloatArray, *, progress: Progress = silent) -> FloatArray:
        """States (n, steps+1, n_x) from ``x0`` (n, n_x) under ``u`` (n, steps, n_u)."""

    def step(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """One step from ``x`` (n, n_x), lifted afresh, under ``u`` (n, n_u)."""


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Content):
    """Scores of n predictions, one row each. A diverged prediction keeps its row and stays out of the numbers of its
    kind.
    """

    x0: FloatArray
    """First states (n, n_x)."""
    rmse: FloatArray
    """Errors (n,) in percent of predictions that are lifted once."""
    rmse_printed: FloatArray
    """The same (n,) in percent, by the formula as the paper prints it."""
    rmse_relift: FloatArray
    """Errors (n,) in percent of predictions that are lifted afresh at every step."""
    start_error: FloatArray
    """Errors (n,) in percent at k = 0 alone."""
    max_error: FloatArray
    """The largest error (n, n_x) of each state, in its unit."""
    in_domain: FloatArray
    """The share (n,) of true samples inside the training box."""
    distance: FloatArray
    """Distances (n,) of x0 to the training states, in half-widths of their box."""
    outside: BoolArray
    """Whether x0 lies outside the convex hull of the training states (n,)."""
    bound: FloatArray
    """What the predictor's own estimate says ``rmse`` stays below (n,) in percent; not a number without any."""
    diverged: BoolArray
    """Whether the prediction that is lifted once diverges (n,)."""
    diverged_relift: BoolArray
    """Whether the prediction that is lifted afresh diverges (n,)."""
    start: IndexArray
    """The sample (n,) that each prediction starts from, above 0 where predictions restart."""
    steps: int
    """Steps of the longest prediction."""
    first: int
    """The first scored sample after the start of a prediction."""
    functions: int
    """Dimension of the predictor's lifted state."""
    state_channels: Channels
    """Names and units of the states."""
    restart: int | None = None
    """Steps until a prediction starts afresh from the true state, None for never."""

    def __repr__(self) -> str:
        rmse, lost = metrics.summary(self.rmse[~self.diverged]), int(self.diverged.sum())
        return (
            f"Evaluation: {len(self.rmse)} predictions of {self.steps} steps, RMSE mean {rmse['mean']:.4g} %, median "
            f"{rmse['median']:.4g} %, max {rmse['max']:.4g} %{f'; {lost} diverged' if lost else ''}"
        )

    def figures(self) -> Meta:
        """The numbers that scripts read (`--json`)."""
        valid = ~self.diverged
        inside = valid & (self.in_domain == 1)
        with np.errstate(invalid="ignore"):
            worst = [float(np.max(e[valid], initial=0.0)) for e in self.max_error.T]
        return {
            "rmse": metrics.summary(self.rmse[valid]),
            "rmse_printed": metrics.summary(self.rmse_printed[valid]),
            "rmse_relift": metrics.summary(self.rmse_relift[~self.diverged_relift]),
            "rmse_in_domain": metrics.summary(self.rmse[inside]),
            "start_error": metrics.summary(self.start_error[valid]),
            "max_error": dict(zip(self.state_channels.names, worst, strict=True)),
            "trajectories": int((self.start == 0).sum()),
            "trajectories_in_domain": int((self.in_domain == 1).sum()),
            "steps": self.steps,
            "diverged": int(self.diverged.sum()),
            "diverged_relift": int(self.diverged_relift.sum()),
            "undefined": int(np.isnan(self.rmse[valid]).sum()),
            "in_domain_share": float(self.in_domain.mean()),
            "outside": int(self.outside.sum()),
            "worst_in_emptiest": metrics.overlap_of_largest(self.rmse[valid], self.distance[valid]),
            "functions": self.functions,
            "bound": self._bound(),
            **({} if self.restart is None else {"restart": self.restart, "segments": self._segments()}),
        }

    def _bound(self) -> Meta | None:
        """How many errors stay below the bounds given for them, and how large these are."""
        given = np.isfinite(self.bound) & np.isfinite(self.rmse)
        if not given.any():
            return None
        below = (self.rmse <= self.bound) & ~self.diverged
        return {"covered": float(below[given].mean()), **metrics.summary(self.bound[given])}

    def _segments(self) -> list[Meta]:
        """The mean RMSE of the predictions that start from each sample."""
        segments = []
        for k in np.unique(self.start).tolist():
            rows = (self.start == k) & ~self.diverged
            segments.append({"start": k, "rmse": metrics.summary(self.rmse[rows])["mean"]})
        return segments

    def table(self) -> tuple[list[str], list[list[float]]]:
        """The per-trajectory table: column names with units, and rows."""
        states = list(zip(self.state_channels.names, self.state_channels.units, strict=True))
        header = [f"{name}_0 ({unit})" for name, unit in states]
        header += ["rmse (%)", "rmse_printed (%)", "rmse_relift (%)", "start_error (%)"]
        header += [f"max_error {name} ({unit})" for name, unit in states]
        header += [
            "in_domain (1)",
            "distance (half-widths)",
            "outside (1)",
            "bound (%)",
            "diverged (1)",
            "diverged_relift (1)",
        ]
        columns: list[Any] = [self.x0, self.rmse, self.rmse_printed, self.rmse_relift, self.start_error, self.max_error]
        columns += [self.in_domain, self.distance, self.outside, self.bound, self.diverged, self.diverged_relift]
        if self.restart is not None:
            header, columns = ["start (samples)", *header], [self.start, *columns]
        return header, np.column_stack(columns).tolist()

    def pack(self) -> Packed:
        """The evaluation for storage."""
        units = self.state_channels.unit_text
        row, per_state = ("trajectory",), ("trajectory", "state")
        arrays = {
            "x0": Array(self.x0, per_state, units),
            "rmse": Array(self.rmse, row, "%"),
            "rmse_printed": Array(self.rmse_printed, row, "%"),
            "rmse_relift": Array(self.rmse_relift, row, "%"),
            "start_error": Array(self.start_error, row, "%"),
            "max_error": Array(self.max_error, per_state, units),
            "in_domain": Array(self.in_domain, row, "1"),
            "distance": Array(self.distance, row, "1"),
            "outside": Array(self.outside, row, "1"),
            "bound": Array(self.bound, row, "%"),
            "diverged": Array(self.diverged, row, "1"),
            "diverged_relift": Array(self.diverged_relift, row, "1"),
            "start": Array(self.start, row, "samples"),
        }
        meta = {
            "steps": self.steps,
            "first": self.first,
            "functions": self.functions,
            "restart": self.restart,
            "state_channels": self.state_channels.pack(),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Evaluation:
        """The inverse of :meth:`pack`."""
        meta = dict(packed.meta)
        channels = Channels.unpack(meta.pop("state_channels"))
        return cls(**{n: a.values[...] for n, a in packed.arrays.items()}, **meta, state_channels=channels)


def evaluate(
    predictor: Forecaster,
    trajectories: Trajectories,
    rows: slice,
    first: int,
    restart: int | None = None,
    relift: bool = True,
    progress: Progress = silent,
) -> Evaluation:
    """Score ``predictor`` on the trajectories ``rows``, samples k = ``first`` .. steps.

    With ``restart`` a prediction starts afresh from the true state every so many steps, and each is scored from the
    ``first`` sample after its start; rows run by trajectory, then by start. Without ``relift`` there is no score of
    that kind. Raises ``InvalidValueError`` when states, inputs or sampling period differ from the predictor's.
    """
    _check(predictor, trajectories, first, restart)
    x, u = np.asarray(trajectories.x[rows]), np.asarray(trajectories.u[rows])
    every = restart or trajectories.steps
    parts = []
    for k in range(0, trajectories.steps, every):
        stop = min(k + every, trajectories.steps)
        part = within(progress, k, stop, trajectories.steps)
        parts.append(_score(predictor, x[:, k : stop + 1], u[:, k:stop], first, k, relift, part))
        part(1, 1)
    order = np.argsort(np.tile(np.arange(len(x)), len(parts)), kind="stable")
    steps = min(every, trajectories.steps)
    return replace(_reordered(join(parts), order), restart=restart, steps=steps)


def _score(
    predictor: Forecaster,
    x: FloatArray,
    u: FloatArray,
    first: int,
    start: int,
    lifted_afresh: bool,
    progress: Progress,
) -> Evaluation:
    """The scores of one prediction for each of ``x`` (n, steps+1, n_x) under ``u`` (n, steps, n_u)."""
    domain, bound = predictor.coverage.domain, predictor.bound(x[:, 0])
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging prediction is a result, not an accident
        kinds = 1 + lifted_afresh
        once = predictor.predict(x[:, 0], u, progress=within(progress, 0, 1, kinds))
        afresh = within(progress, 1, 2, kinds)
        relift = np.empty_like(once)
        relift[:, 0], at = once[:, 0], x[:, 0]  # the first step starts from the state that is known
        relift[:, 1:] = np.nan
        for k in range(u.shape[1] if lifted_afresh else 0):
            relift[:, k + 1] = at = predictor.step(at, u[:, k])
            afresh(k + 1, u.shape[1])
        scored = slice(first, None)
        return Evaluation(
            x0=x[:, 0],
            rmse=metrics.rmse(once[:, scored], x[:, scored]),
            rmse_printed=metrics.rmse_printed(once[:, scored], x[:, scored]),
            rmse_relift=metrics.rmse(relift[:, scored], x[:, scored]),
            start_error=metrics.rmse(once[:, :1], x[:, :1]),
            max_error=np.abs(once[:, scored] - x[:, scored]).max(axis=1),
            in_domain=metrics.in_domain(x[:, scored], domain),
            distance=predictor.coverage.distance(x[:, 0]),
            outside=predictor.coverage.outside(x[:, 0]),
            bound=np.full(len(x), np.nan) if bound is None else bound,
            diverged=metrics.diverged(once[:, scored], domain),
            diverged_relift=metrics.diverged(relift[:, scored], domain) & lifted_afresh,
            start=np.full(len(x), start),
            steps=u.shape[1],
            first=first,
            functions=predictor.functions,
            state_channels=predictor.state_channels,
        )


def join(parts: Sequence[Evaluation]) -> Evaluation:
    """One evaluation from those of consecutive rows."""
    rows = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Evaluation)
        if isinstance(getattr(parts[0], field.name), np.ndarray)
    }
    return replace(parts[0], **rows)  # type: ignore[arg-type]  # mypy does not pair names with types here


def _reordered(evaluation: Evaluation, order: IndexArray) -> Evaluation:
    rows = {
        field.name: getattr(evaluation, field.name)[order]
        for field in fields(Evaluation)
        if isinstance(getattr(evaluation, field.name), np.ndarray)
    }
    return replace(evaluation, **rows)


def _check(predictor: Forecaster, trajectories: Trajectories, first: int, restart: int | None) -> None:
    if (predictor.state_channels, predictor.input_channels) != (
        trajectories.state_channels,
        trajectories.input_channels,
    ):
        raise InvalidValueError("the trajectories and the predictor have different states or inputs")
    if predictor.dt != trajectories.dt:
        raise InvalidValueError(
            f"the predictor steps by {predictor.dt} s, the trajectories by {trajectories.dt} s: simulate with --dt"
        )
    shortest = shortest_prediction(trajectories.steps, restart)
    if not 0 <= first <= shortest:
        raise InvalidValueError(f"'evaluate.first' must be at most {shortest} steps, got {first}")


def shortest_prediction(steps: int, restart: int | None) -> int:
    """Steps of the shortest prediction of a trajectory of ``steps``: the last one's, if they do not come out even."""
    return steps if restart is None or restart >= steps else steps % restart or restart
