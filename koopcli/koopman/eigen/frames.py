"""Frames in which what follows a state is interpolated: the state's own, or the world's (docs/equations.md 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import Channels, FloatArray

PLANAR = ("v_x", "v_y", "yaw_rate")  # the first states of a body in the plane


@dataclass(frozen=True)
class Frame:
    """``seen(x, dt)``: futures ``x`` (n, samples, n_x) in the frame; ``back(seen, x0, dt)``: the inverse, of a future
    from ``x0`` (n, n_x); ``back_with_slopes(seen, x0, dt)``: the same of ``seen`` (n, samples, n_x, 1 + n_x),
    which holds the derivatives in x0 beside each value.
    """

    seen: Callable[[FloatArray, float], FloatArray]
    back: Callable[[FloatArray, FloatArray, float], FloatArray]
    back_with_slopes: Callable[[FloatArray, FloatArray, float], FloatArray]


def yaw(yaw_rate: FloatArray, dt: float) -> FloatArray:
    """The angle (n, samples, ...) in rad turned since the first sample, by the trapezoidal rule (7.13)."""
    angle = np.zeros_like(yaw_rate)
    np.cumsum(dt * (yaw_rate[:, 1:] + yaw_rate[:, :-1]) / 2, axis=1, out=angle[:, 1:])
    return angle


def turned(x: FloatArray, angle: FloatArray) -> FloatArray:
    """``x`` with its velocity turned to the left by ``angle``."""
    c, s = np.cos(angle), np.sin(angle)
    out = x.copy()
    out[..., 0] = c * x[..., 0] - s * x[..., 1]
    out[..., 1] = s * x[..., 0] + c * x[..., 1]
    return out


def _in_the_world(x: FloatArray, dt: float) -> FloatArray:
    """The change since the first sample of the velocity in axes that stay, and of every other state."""
    moving = turned(x, yaw(x[..., 2], dt))
    return moving - moving[:, :1]


def _in_the_body(seen: FloatArray, x0: FloatArray, dt: float) -> FloatArray:
    moving = seen + x0[:, np.newaxis]
    return turned(moving, -yaw(moving[..., 2], dt))


def _slopes_in_the_body(seen: FloatArray, x0: FloatArray, dt: float) -> FloatArray:
    moving = seen.copy()
    moving[..., 0] += x0[:, np.newaxis]
    moving[..., 1:] += np.eye(x0.shape[1])
    angle = yaw(moving[:, :, 2], dt)  # and how it changes with x0, (n, samples, 1 + n_x)
    c, s = np.cos(angle[..., :1]), np.sin(angle[..., :1])
    v_x, v_y = moving[:, :, 0], moving[:, :, 1]
    moving[:, :, 0], moving[:, :, 1] = c * v_x + s * v_y, c * v_y - s * v_x
    moving[:, :, 0, 1:] += moving[:, :, 1, :1] * angle[..., 1:]
    moving[:, :, 1, 1:] -= moving[:, :, 0, :1] * angle[..., 1:]
    return moving


FRAMES: dict[str, Frame] = {
    "state": Frame(lambda x, dt: x, lambda seen, x0, dt: seen, lambda seen, x0, dt: seen),
    "world": Frame(_in_the_world, _in_the_body, _slopes_in_the_body),
}


def check_frame(name: str, states: Channels) -> None:
    """Raise ``InvalidValueError`` for states that the frame cannot be told from."""
    if name == "world" and states.names[: len(PLANAR)] != PLANAR:
        raise InvalidValueError(
            f"world coordinates turn the velocity by the yaw rate and need the states {', '.join(PLANAR)} first, got "
            f"{', '.join(states.names)}: choose the coordinates 'state'"
        )
