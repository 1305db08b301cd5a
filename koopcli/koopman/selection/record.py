"""The record of a selection: the rung that was chosen, and how good it is on rows that no fit saw."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from koopcli.content import Content
from koopcli.koopman.selection.regress import Rung
from koopcli.koopman.selection.windows import HORIZONS, TINY, nearest
from koopcli.records import Array, Channels, FloatArray, IntArray, Meta, Packed

HOLD, MEAN, DMDC_ROW, CHOSEN, BICYCLE = "hold", "mean", "dmdc", "chosen", "bicycle"
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)  # quantiles of past errors


@dataclass(frozen=True, eq=False, repr=False)
class Selection(Content):
    """Which rung of a ladder a measured log is best predicted by, and the verdict of blocks held out from it."""

    rungs: tuple[Rung, ...]
    """The ladder, from the simplest on."""
    chosen: int
    """The place of the rung that the whole log chooses."""
    scores: FloatArray
    """(rungs, inner blocks): mean log RMSE of the whole log's choice; not a number for a block without a window."""
    blind: bool
    """Whether the log, or the log without a block, is too short to compare rungs: then the first is taken."""
    picked: IntArray
    """(blocks,): the place of the rung chosen without each outer block."""
    models: tuple[str, ...]
    """What forecast the held-out windows: hold, mean, dmdc, chosen, and bicycle where it was asked for."""
    errors: FloatArray
    """(models, blocks, steps, n_x): RMSE of every step up to 1 s, in the units of the states."""
    windows: IntArray
    """(blocks,): windows of each outer block."""
    quantiles: FloatArray
    """(levels, steps, n_x): of truth minus forecast of what was chosen, at ``LEVELS``, in the units of the states."""
    spread: FloatArray
    """(n_x,): standard deviation of each state, in its unit."""
    gain: FloatArray
    """(n_x,): gain in R² of the 0.5 s change of a state by the mean input."""
    gain_with_products: FloatArray
    """(n_x,): the same with the products of the mean input and the state."""
    use: FloatArray
    """(n_u,): range of an input in a block over that in its training rows, the largest; nan where it never moves."""
    outside_share: float
    """Share of held-out rows with a state outside the box of the training states."""
    limited_share: float
    """Share of held-out rows with an input outside its training range, which is limited."""
    dt: float
    """Sampling period in s."""
    state_channels: Channels
    input_channels: Channels
    verdict: str = ""
    """The verdict in plain sentences."""

    def __repr__(self) -> str:
        return f"Selection: {self.chosen_rung} of {len(self.rungs)} rungs\n  {self.verdict}"

    @property
    def chosen_rung(self) -> str:
        """The chosen rung in words."""
        return self.rungs[self.chosen].label

    @property
    def judged(self) -> list[int]:
        """The places of the horizons among the steps."""
        return [nearest(time, self.dt) - 1 for time in HORIZONS]

    def pooled(self, model: str) -> FloatArray:
        """RMSE of a ``model`` over the windows of all blocks, (steps, n_x)."""
        squares = self._errors(model) ** 2
        return np.asarray(np.sqrt(np.average(squares, axis=0, weights=self.windows)))

    def ratios(self, model: str, reference: str) -> FloatArray:
        """RMSE of a ``model`` over that of a ``reference``, pooled, at the horizons: (horizons, n_x)."""
        return np.asarray(self.pooled(model)[self.judged] / self.pooled(reference)[self.judged])

    def ratio(self, model: str, reference: str) -> float:
        """The geometric mean of :meth:`ratios` over states and horizons."""
        return _geometric(self.ratios(model, reference))

    def block_ratios(self, model: str, reference: str) -> FloatArray:
        """The same of each block on its own, (blocks,)."""
        both = self._errors(model)[:, self.judged], self._errors(reference)[:, self.judged]
        return np.array([_geometric(above / below) for above, below in zip(*both, strict=True)])

    def span(self, model: str) -> tuple[FloatArray, FloatArray]:
        """The smallest and the largest RMSE of all blocks, each (steps, n_x)."""
        errors = self._errors(model)
        return errors.min(axis=0), errors.max(axis=0)

    def _errors(self, model: str) -> FloatArray:
        least = TINY * self.spread + np.finfo(float).tiny
        return np.asarray(np.maximum(self.errors[self.models.index(model)], least))

    def figures(self) -> Meta:
        """The figures as JSON; horizons in s, errors in the units of the states, ratios and shares between numbers."""
        return {
            "chosen_rung": self.chosen_rung,
            "verdict": self.verdict,
            "ratio_to_dmdc": self.ratio(CHOSEN, DMDC_ROW),
            "ratio_to_hold": self.ratio(CHOSEN, HOLD),
            "per_state": self._per_state(),
            "blocks": [
                {"picked": self.rungs[place].label, "ratio_to_dmdc": ratio}
                for place, ratio in zip(self.picked.tolist(), self.block_ratios(CHOSEN, DMDC_ROW).tolist(), strict=True)
            ],
            "outside_share": self.outside_share,
            "limited_share": self.limited_share,
        }

    def _per_state(self) -> Meta:
        error = self.pooled(CHOSEN)[self.judged].tolist()
        to_hold, to_dmdc = (self.ratios(CHOSEN, other).tolist() for other in (HOLD, DMDC_ROW))
        return {
            name: {
                f"{time:g}": {"rmse": error[h][i], "to_hold": to_hold[h][i], "to_dmdc": to_dmdc[h][i]}
                for h, time in enumerate(HORIZONS)
            }
            for i, name in enumerate(self.state_channels.names)
        }

    def pack(self) -> Packed:
        """The selection for storage."""
        units = self.state_channels.unit_text
        arrays = {
            "scores": Array(self.scores, ("rung", "inner_block"), "1"),
            "picked": Array(self.picked, ("block",), "1"),
            "errors": Array(self.errors, ("model", "block", "step", "state"), units),
            "windows": Array(self.windows, ("block",), "1"),
            "quantiles": Array(self.quantiles, ("level", "step", "state"), units),
            "spread": Array(self.spread, ("state",), units),
            "gain": Array(self.gain, ("state",), "1"),
            "gain_with_products": Array(self.gain_with_products, ("state",), "1"),
            "use": Array(self.use, ("input",), "1"),
        }
        meta = {
            "rungs": [asdict(rung) for rung in self.rungs],
            "chosen": self.chosen,
            "blind": self.blind,
            "models": list(self.models),
            "levels": list(LEVELS),
            "outside_share": self.outside_share,
            "limited_share": self.limited_share,
            "dt": self.dt,
            "state_channels": self.state_channels.pack(),
            "input_channels": self.input_channels.pack(),
            "verdict": self.verdict,
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Selection:
        """The inverse of :meth:`pack`."""
        facts = {name: packed.meta[name] for name in ("chosen", "blind", "outside_share", "limited_share", "dt")}
        return cls(
            rungs=tuple(Rung(**rung) for rung in packed.meta["rungs"]),
            models=tuple(packed.meta["models"]),
            state_channels=Channels.unpack(packed.meta["state_channels"]),
            input_channels=Channels.unpack(packed.meta["input_channels"]),
            verdict=packed.meta["verdict"],
            **facts,
            **{name: array.values[...] for name, array in packed.arrays.items()},
        )


def _geometric(ratios: FloatArray) -> float:
    return float(np.exp(np.log(ratios).mean()))
