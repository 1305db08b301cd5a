"""The bicycle identified from the same rows: what a few physical parameters achieve, to compare with (10.15)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.koopman.selection.blocks import Piece, row_numbers
from koopcli.koopman.selection.regress import FAR
from koopcli.koopman.selection.windows import INNER, Windows, ahead_of, nearest
from koopcli.records import Channels, FloatArray, IndexArray

FITTED = (0.1, 0.25, 0.5)  # s after the start of a roll-out, where its states are fitted
WINDOWS = 400  # roll-outs at most
TRIES = 40  # steps of the least squares at most
SLOW = 0.05  # of the top speed, below which slip angles are not trusted
WIDE = 1e3  # spreads: a residual beyond it counts as that
SHIFT = 1e-6  # of the finite differences
LATERAL = ("log a1", "a2", "a3", "a4", "log a5", "a6", "zero of the steer", "log lag")


@dataclass(frozen=True)
class Roles:
    """Places of the states and inputs that a bicycle knows; ``v_y`` is None where it is not a state."""

    v_x: int
    yaw_rate: int
    v_y: int | None
    steer: int
    others: tuple[int, ...]

    @property
    def known(self) -> list[int]:
        """The places of the states that it forecasts."""
        return [self.v_x, self.yaw_rate] + ([] if self.v_y is None else [self.v_y])


def roles_of(states: Channels, inputs: Channels) -> Roles | None:
    """The roles of a log's channels by their names, or None without v_x, yaw_rate and steer."""
    if not {"v_x", "yaw_rate"} <= set(states.names) or "steer" not in inputs.names:
        return None
    steer = inputs.names.index("steer")
    return Roles(
        v_x=states.names.index("v_x"),
        yaw_rate=states.names.index("yaw_rate"),
        v_y=states.names.index("v_y") if "v_y" in states.names else None,
        steer=steer,
        others=tuple(i for i in range(len(inputs)) if i != steer),
    )


@dataclass(frozen=True, eq=False)
class Bicycle:
    """A linear single-track model with ``parameters`` (8 + 2 + other inputs,), those of :data:`LATERAL` first.

    v_y' = -(a1 v_y + a2 r)/v - v r + a3 δ and r' = -(a4 v_y + a5 r)/v + a6 δ with a steer that lags and has a zero of
    its own; v' = q0 + q1 v + q · other inputs + v_y r. Inputs are limited to ``low`` and ``high`` (n_u,), states to
    ``floor`` and ``ceiling`` (n_x,); ``slow``: the least v, in m/s, that is divided by.
    """

    roles: Roles
    parameters: FloatArray
    dt: float
    history: int
    low: FloatArray
    high: FloatArray
    floor: FloatArray
    ceiling: FloatArray
    slow: float

    def predict(self, x: FloatArray, u: FloatArray, starts: IndexArray, steps: int) -> FloatArray:
        """Forecasts (windows, steps, n_x) of x (rows, n_x) from each row of ``starts``; unknown states are held."""
        forecast = np.repeat(x[starts][:, None], steps, axis=1)
        forecast[:, :, self.roles.known] = self.roll(x, u, starts, steps, self.parameters[None])[0]
        return forecast

    def roll(self, x: FloatArray, u: FloatArray, starts: IndexArray, steps: int, sets: FloatArray) -> FloatArray:
        """Roll-outs (sets, windows, steps, known states) of several ``sets`` (sets, parameters) at once."""
        roles, dt, back = self.roles, self.dt, self.history
        rows = starts + np.arange(-back, steps)[:, None]
        held = np.clip(u[rows], self.low, self.high)
        lateral = [column[:, None] for column in sets[:, : len(LATERAL)].T]
        a1, a5, lag = (np.exp(np.clip(lateral[i], -9.0, 9.0)) for i in (0, 4, 7))
        a2, a3, a4, a6, zero = (lateral[i] for i in (1, 2, 3, 5, 6))
        drift, slope, *weights = (column[:, None] for column in sets[:, len(LATERAL) :].T)
        follows = 1.0 - np.exp(-dt / lag)
        shape = (len(sets), len(starts))
        steer = np.broadcast_to(held[0, :, roles.steer], shape) + zero
        v_y = np.zeros(shape)
        states = np.empty((*shape, steps, len(roles.known)))
        v, r = (np.broadcast_to(x[starts, i], shape) for i in (roles.v_x, roles.yaw_rate))
        for k in range(-back, steps):
            steer = steer + follows * (held[k + back, :, roles.steer] + zero - steer)
            if k < 0:  # the hidden side speed and the lagging steer find themselves before the start
                past_v, past_r = x[starts + k, roles.v_x], x[starts + k, roles.yaw_rate]
                safe = np.maximum(past_v, self.slow)
                pushed = a3 * steer - a2 * past_r / safe - past_v * past_r
                v_y = (v_y + dt * pushed) / (1.0 + dt * a1 / safe)
                continue
            if k == 0 and roles.v_y is not None:
                v_y = np.broadcast_to(x[starts, roles.v_y], shape)
            safe = np.maximum(v, self.slow)
            push = drift + slope * v + v_y * r
            for weight, i in zip(weights, roles.others, strict=True):
                push = push + weight * held[k + back, :, i]
            v_y, r = _implicit(v_y, r, v, dt / safe, (a1, a2, a4, a5), (dt * a3 * steer, dt * a6 * steer))
            for j, (value, i) in enumerate(zip((v + dt * push, r, v_y), roles.known, strict=False)):
                states[:, :, k, j] = np.clip(np.nan_to_num(value), self.floor[i], self.ceiling[i])
            v, r = states[:, :, k, 0], states[:, :, k, 1]
            v_y = states[:, :, k, 2] if roles.v_y is not None else np.clip(np.nan_to_num(v_y), -FAR, FAR)
        return states


def _implicit(
    v_y: FloatArray,
    r: FloatArray,
    v: FloatArray,
    per_speed: FloatArray,
    damping: tuple[FloatArray, ...],
    push: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """One implicit step of side speed and yaw rate, which stays calm however slow the car is."""
    a1, a2, a4, a5 = damping
    m11, m22 = 1.0 + a1 * per_speed, 1.0 + a5 * per_speed
    m12, m21 = a2 * per_speed + per_speed * np.maximum(v, 0.0) ** 2, a4 * per_speed
    determinant = m11 * m22 - m12 * m21
    determinant = np.where(np.abs(determinant) < 1e-6, 1e-6, determinant)
    right_y, right_r = v_y + push[0], r + push[1]
    return (m22 * right_y - m12 * right_r) / determinant, (m11 * right_r - m21 * right_y) / determinant


def identify(x: FloatArray, u: FloatArray, pieces: Sequence[Piece], windows: Windows, roles: Roles) -> Bicycle:
    """The bicycle with the least squared errors over roll-outs of 0.5 s on the rows of ``pieces``.

    x (rows, n_x) and u (rows, n_u) are in SI units and radians.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  (only where a bicycle is asked for)

    seen = row_numbers(pieces)
    middle, far = x[seen].mean(axis=0), FAR * np.ptp(x[seen], axis=0)
    first = Bicycle(
        roles=roles,
        parameters=_guess(x[seen], u[seen], roles),
        dt=windows.dt,
        history=windows.history,
        low=u[seen].min(axis=0),
        high=u[seen].max(axis=0),
        floor=middle - far,
        ceiling=middle + far,
        slow=SLOW * max(float(np.abs(x[seen, roles.v_x]).max()), 1e-3),
    )
    starts = windows.starts(pieces, INNER)
    if len(starts) == 0:
        return first
    starts = starts[np.unique(np.linspace(0, len(starts) - 1, WINDOWS).round().astype(np.intp))]
    at = [nearest(time, windows.dt) - 1 for time in FITTED]
    truth = ahead_of(x, starts, at[-1] + 1)[:, at][:, :, roles.known]
    scale = np.maximum(x[seen][:, roles.known].std(axis=0), 1e-12)

    def residuals(sets: FloatArray) -> FloatArray:
        missed = first.roll(x, u, starts, at[-1] + 1, sets)[:, :, at] - truth
        return np.asarray(np.clip(missed / scale, -WIDE, WIDE).reshape(len(sets), -1))

    def jacobian(parameters: FloatArray) -> FloatArray:
        shifts = SHIFT * np.maximum(np.abs(parameters), 1.0)
        both = residuals(np.concatenate([parameters + np.diag(shifts), parameters[None]]))
        return np.asarray(((both[:-1] - both[-1]) / shifts[:, None]).T)

    with np.errstate(over="ignore", invalid="ignore"):
        best = least_squares(
            lambda parameters: residuals(parameters[None])[0],
            first.parameters,
            jac=jacobian,
            x_scale="jac",
            loss="soft_l1",
            f_scale=0.3,
            max_nfev=TRIES,
        )
    return Bicycle(**{**vars(first), "parameters": np.asarray(best.x)})


def _guess(x: FloatArray, u: FloatArray, roles: Roles) -> FloatArray:
    """Parameters to begin with: a bicycle that turns by its geometry at the usual speed, and does not push itself."""
    v, r = x[:, roles.v_x], x[:, roles.yaw_rate]
    turn = v * u[:, roles.steer]
    ratio = float(r @ turn / max(float(turn @ turn), 1e-12))  # 1 / wheelbase, where steer is the angle of a wheel
    quick = np.log(10.0 * max(float(np.abs(v).mean()), 1e-3))
    lateral = [quick, 0.0, 0.5 * np.exp(quick) * ratio, 0.0, quick, np.exp(quick) * ratio, 0.0, np.log(0.05)]
    return np.array(lateral + [0.0] * (2 + len(roles.others)))
