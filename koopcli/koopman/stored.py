"""Predictors as they are read back from a store: every kind of lift by its name."""

from __future__ import annotations

from collections.abc import Callable

from koopcli.koopman.bases import STORED, WITH_MEMORY
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.eigen.tabulated import Tabulated
from koopcli.koopman.predictor.dynamics import Dynamics
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import Modes
from koopcli.koopman.predictor.predictor import Predictor, UnpackLift
from koopcli.records import Packed


def _of_basis(unpack: Callable[[Packed], Observables]) -> UnpackLift:
    return lambda packed, _: unpack(packed)


def _of_modes(unpack: Callable[[Packed, Modes], Observables]) -> UnpackLift:
    def table(packed: Packed, dynamics: Dynamics) -> Observables:
        assert isinstance(dynamics, Diagonal), "a table is carried on by modes, with forces or without"
        return unpack(packed, dynamics.modes)

    return table


LIFTS: dict[str, UnpackLift] = {
    **{kind: _of_basis(unpack) for kind, unpack in (STORED | WITH_MEMORY).items()},
    **{table.kind: _of_modes(table.unpack) for table in (Tabulated, Futures)},
}


def predictor(packed: Packed) -> Predictor:
    """The inverse of ``Predictor.pack``."""
    return Predictor.unpack(packed, LIFTS)
