"""Mirror images of trajectories that are trajectories too, free of charge (docs/equations.md 6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray
from koopcli.vehicles.parameters import VehicleParameters

Mirror = Literal["left-right", "front-rear"]

MIRRORS: dict[Mirror, dict[str, float]] = {
    "left-right": {"v_x": 1.0, "v_y": -1.0, "yaw_rate": -1.0, "wheel_rate_f": 1.0, "wheel_rate_r": 1.0},
    "front-rear": {"v_x": -1.0, "v_y": 1.0, "yaw_rate": -1.0},
}  # signs of states; without inputs, f(S x) = S f(x) (6.6)


def signs(name: Mirror, p: VehicleParameters, states: Sequence[str]) -> FloatArray:
    """The signs (n_x,) that the ``states`` of a vehicle change under the mirror ``name``.

    Raises ``InvalidValueError`` for a vehicle without that symmetry, and for states that change places under it.
    """
    if strange := [state for state in states if state not in MIRRORS[name]]:
        raise InvalidValueError(f"the mirror '{name}' changes more than the sign of {', '.join(strange)}: leave it out")
    if name == "front-rear" and (p.lateral_rear or p.lateral) != p.lateral:
        raise InvalidValueError(
            "this vehicle has no front-rear symmetry: its axles have different tyres; leave the mirror out"
        )
    if name == "front-rear" and p.l_f != p.l_r:
        raise InvalidValueError(
            f"this vehicle has no front-rear symmetry: its axles differ in their arms (l_f {p.l_f:g} m, l_r {p.l_r:g} "
            "m) and so in their loads; leave out the mirror 'front-rear'"
        )
    return np.array([MIRRORS[name][state] for state in states])


def images(names: tuple[Mirror, ...], p: VehicleParameters, states: Sequence[str]) -> list[FloatArray]:
    """The signs of every image but the original, of mirrors and of their combinations.

    Raises ``InvalidValueError`` for a vehicle without one of the symmetries.
    """
    images = [np.ones(len(states))]
    for name in names:
        images += [image * signs(name, p, states) for image in images]
    return images[1:]
