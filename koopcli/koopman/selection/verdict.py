"""How good the chosen rung is on blocks that neither its fit nor its choice saw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.selection.bicycle import Roles, identify
from koopcli.koopman.selection.blocks import Fold, Holding, row_numbers
from koopcli.koopman.selection.choice import Choice, choose
from koopcli.koopman.selection.drive import outside
from koopcli.koopman.selection.record import BICYCLE, CHOSEN, DMDC_ROW, HOLD, MEAN
from koopcli.koopman.selection.regress import DMDC, Rung, fit, pair_rows
from koopcli.koopman.selection.windows import OUTER, Windows, ahead_of, rmse
from koopcli.records import Array, BoolArray, FloatArray, Packed


@dataclass(frozen=True, eq=False)
class Block:
    """What came of one outer block: the ``choice`` without it, and the errors on its windows.

    ``errors``: RMSE (steps, n_x) by model; ``missed`` (windows, steps, n_x): truth minus forecast of the picked rung;
    ``outside`` and ``limited`` (held-out rows,): which have a state, an input outside the training rows' range.
    """

    choice: Choice
    errors: dict[str, FloatArray]
    missed: FloatArray
    outside: BoolArray
    limited: BoolArray

    def pack(self) -> Packed:
        """The block for another process."""
        arrays = {
            **{f"errors/{name}": Array(values, ("step", "state"), "1") for name, values in self.errors.items()},
            "missed": Array(self.missed, ("window", "step", "state"), "1"),
            "outside": Array(self.outside.astype(np.int8), ("row",), "1"),
            "limited": Array(self.limited.astype(np.int8), ("row",), "1"),
            "scores": Array(self.choice.scores, ("rung", "inner_block"), "1"),
        }
        return Packed(arrays, {"picked": self.choice.picked, "blind": self.choice.blind, "models": list(self.errors)})

    @classmethod
    def unpack(cls, packed: Packed) -> Block:
        """The inverse of :meth:`pack`."""
        values = {name: np.asarray(array.values[...]) for name, array in packed.arrays.items()}
        return cls(
            choice=Choice(packed.meta["picked"], values["scores"], packed.meta["blind"]),
            errors={name: values[f"errors/{name}"] for name in packed.meta["models"]},
            missed=values["missed"],
            outside=values["outside"].astype(bool),
            limited=values["limited"].astype(bool),
        )


def judge(
    x: FloatArray,
    u: FloatArray,
    fold: Fold,
    rungs: Sequence[Rung],
    windows: Windows,
    holding: Holding,
    roles: Roles | None = None,
) -> Block:
    """The held-out block of a ``fold`` of x (rows, n_x) and u (rows, n_u), forecast by what is chosen without it.

    ``roles``: which states and inputs a bicycle knows; it is identified and forecasts as well.
    """
    starts = windows.starts(fold.held, OUTER)
    truth = ahead_of(x, starts, windows.ahead)
    choice = choose(x, u, fold.training, rungs, windows, holding)
    models = {DMDC_ROW: DMDC, CHOSEN: rungs[choice.picked]}
    forecasts = {
        HOLD: np.broadcast_to(x[starts][:, None], truth.shape),
        MEAN: np.broadcast_to(x[row_numbers(fold.training)].mean(axis=0), truth.shape),
        **{
            name: fit(x, u, fold.training, rung, windows.dt).predict(x, u, starts, windows.ahead)
            for name, rung in models.items()
        },
    }
    if roles is not None:
        forecasts[BICYCLE] = identify(x, u, fold.training, windows, roles).predict(x, u, starts, windows.ahead)
    return Block(
        choice=choice,
        errors={name: rmse(forecast - truth) for name, forecast in forecasts.items()},
        missed=truth - forecasts[CHOSEN],
        outside=outside(x, fold),
        limited=outside(u, fold),
    )


def refuse_short(folds: Sequence[Fold], windows: Windows) -> None:
    """Raise ``InvalidValueError`` where a block has no window, or its training rows no step to learn from."""
    for i, fold in enumerate(folds):
        if len(windows.starts(fold.held, OUTER)) == 0 or len(pair_rows(fold.training, windows.history)) == 0:
            raise InvalidValueError(
                f"the log is too short: block {i + 1} of {len(folds)} has no window of {windows.length:g} s, or leaves "
                "none to learn from; record more without interruption, or ask for fewer outer blocks"
            )


def refuse_still(x: FloatArray, names: Sequence[str]) -> None:
    """Raise ``InvalidValueError`` where a state of x (rows, n_x) never changes, or is not a number somewhere."""
    for name, column in zip(names, x.T, strict=True):
        if not np.isfinite(column).all():
            raise InvalidValueError(f"state {name} has values that are not numbers: drop those rows at the import")
        if np.ptp(column) <= 1e-12 * np.abs(column).max():
            raise InvalidValueError(
                f"state {name} never changes, it is {column[0]:g} in all {len(column)} rows: leave it out, or record "
                "a drive in which it changes"
            )
