"""What a controller in a loop is: a protocol, and what it tells of each step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

TS = 0.01  # s, the sampling period of every loop


@dataclass(frozen=True)
class Facts:
    """Of one step: whether its programme was ``solved``, and the ``kkt`` residual, infinite where it has none.

    A controller that solves nothing is always right: True and zero.
    """

    solved: bool
    kkt: float


FREE = Facts(True, 0.0)


@dataclass(frozen=True, eq=False)
class Plan:
    """Predicted ``states`` (N + 1, 3) at ``times`` (N + 1,) in s from now, and ``inputs`` (N, 4) held in between.

    Inputs are axle forces [F_fx, F_fy, F_rx, F_ry] in N, or [steer_f, slip_f, steer_r, slip_r] in rad and 1.
    """

    times: FloatArray
    states: FloatArray
    inputs: FloatArray


class Control(Protocol):
    """A controller with the memory of one car; a new one, or one that was :meth:`reset`, starts at zero inputs."""

    facts: Facts
    """Of the last step."""

    @property
    def times(self) -> FloatArray:
        """When from now, in s, the reference is wanted, (N,)."""

    @property
    def plan(self) -> Plan | None:
        """What was planned in the last step; None before the first, and for a controller that plans nothing."""

    def reset(self) -> None:
        """Forget everything."""

    def step(self, x: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs [steer_f, slip_f, steer_r, slip_r] (4,) in rad and 1 that are to be held for the next ``TS`` seconds.

        ``x`` (3,): v_x, v_y in m/s and yaw rate in rad/s; ``reference`` at ``times`` (N, 3), or one that stays, (3,).
        Raises ``InvalidValueError`` for shapes that do not fit and a state that is not finite.
        """


def checked(x: FloatArray, reference: FloatArray, steps: int) -> tuple[FloatArray, FloatArray]:
    """The state (3,), and the reference as (steps, 3). Raises ``InvalidValueError`` as :meth:`Control.step`."""
    x, reference = np.asarray(x, dtype=float), np.asarray(reference, dtype=float)
    if x.shape != (3,) or reference.shape not in ((3,), (steps, 3)):
        raise InvalidValueError(
            f"a step takes one state (3,) and a reference (3,) or ({steps}, 3), got {x.shape} and {reference.shape}: "
            "give one car and the reference at the controller's times"
        )
    if not np.isfinite(x).all():
        raise InvalidValueError(f"the state {x.tolist()} is not finite: end the loop where the plant diverges")
    return x, np.broadcast_to(reference, (steps, 3))
