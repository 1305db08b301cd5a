"""Mirror images of trajectories that are trajectories too, free of charge (docs/equations.md 6)."""

from __future__ import annotations

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray
from koopcli.vehicles.parameters import VehicleParameters

MIRRORS: dict[str, tuple[float, float, float]] = {
    "left-right": (1.0, -1.0, -1.0),
    "front-rear": (-1.0, 1.0, -1.0),
}  # signs of v_x, v_y and the yaw rate; without inputs, f(S x) = S f(x) (6.6)


def signs(name: str, p: VehicleParameters) -> FloatArray:
    """The signs (3,) that the states of a vehicle change under the mirror ``name``.

    Raises ``InvalidValueError`` for a vehicle without that symmetry.
    """
    if name == "front-rear" and p.l_f != p.l_r:
        raise InvalidValueError(
            f"this vehicle has no front-rear symmetry: its axles differ in their arms (l_f {p.l_f:g} m, l_r {p.l_r:g} "
            "m) and so in their loads; leave out the mirror 'front-rear'"
        )
    return np.array(MIRRORS[name])


def images(names: tuple[str, ...], p: VehicleParameters) -> list[FloatArray]:
    """The signs of every image but the original, of mirrors and of their combinations.

    Raises ``InvalidValueError`` for a vehicle without one of the symmetries.
    """
    found = [np.ones(3)]
    for name in names:
        found += [one * signs(name, p) for one in found]
    return found[1:]
