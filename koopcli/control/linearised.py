"""A receding horizon on steer and slip, with the slip plant linearised: the baselines LTV and RTI."""

from __future__ import annotations

import numpy as np

from koopcli.control import qp
from koopcli.control.condense import Prediction
from koopcli.control.control import FREE, TS, Facts, Plan, checked
from koopcli.control.limits import SCALE, Limits
from koopcli.control.planner import Costs, quadratic
from koopcli.control.tyres import Tyres
from koopcli.records import FloatArray
from koopcli.simulation.integrate import Rhs, rk4_step
from koopcli.vehicles.plants.forces import ForceInput
from koopcli.vehicles.plants.slips import SlipInput

DIFFERENCE = 1e-5
SUBSTEPS = 4


class Linearised:
    """One car under control, by the plant ``slips`` on ``tyres`` as its controller knows them; N ``steps`` of ``h`` s.

    ``along``: whether it is linearised at every step of the prediction (RTI), else once at the measured state and the
    inputs that act (LTV). Decisions are the inputs over the bounds of ``SCALE``.
    """

    def __init__(self, tyres: Tyres, limits: Limits, costs: Costs, steps: int, h: float, along: bool) -> None:
        qp.daqp()
        self.steps, self.h, self.along = steps, h, along
        self.times: FloatArray = np.asarray(h * np.arange(1.0, steps + 1))
        self._plant = SlipInput(tyres.parameters, tyres.v_eps, tyres.combined)
        self._body, self._tyres = ForceInput(tyres.parameters), tyres
        self._limits, self._change = limits, costs.change
        self._root, self._smooth = quadratic(costs, steps, h)
        self._rows = np.eye(4 * steps) - np.eye(4 * steps, k=-4)
        self.reset()

    def reset(self) -> None:
        """Forget the plan: the next step is the first one, at zero steer and slip."""
        self._v, self._u = np.zeros((self.steps, 4)), np.zeros(4)
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self.facts = FREE

    @property
    def plan(self) -> Plan | None:
        """The linearised prediction under the plan of the last step; None before the first."""
        if self._last is None:
            return None
        states, S, before = self._last
        moved = (S @ (self._v - before).ravel()).reshape(-1, 3)
        return Plan(
            np.concatenate([[0.0], self.times]),
            states + np.concatenate([np.zeros((1, 3)), moved]),
            self._v * SCALE,
        )

    def step(self, x: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs (4,) to hold for the next sample, at ``x`` (3,) with the ``reference`` at ``times`` (N, 3), or (3,).

        Raises ``InvalidValueError`` for shapes that do not fit and a state that is not finite.
        """
        x, reference = checked(x, reference, self.steps)
        now = self._u / SCALE
        if self.along:
            v = self._v.copy()
            v[:-1] += (TS / self.h) * (v[1:] - v[:-1])
            states, S = self._rolled(x, v)
        else:
            v = np.tile(now, (self.steps, 1))
            states, S = self._once(x, now)
        weighted = S * self._root[:, np.newaxis]
        error = self._root * (states[1:] - reference).ravel() - weighted @ v.ravel()
        H = weighted.T @ weighted + self._smooth
        f = weighted.T @ error
        f[:4] -= self._change * now
        upper, lower = self._bounds(now)
        solution = qp.solve(H, f, self._rows, upper, lower)
        self._v = solution.point.reshape(self.steps, 4) if solution.accepted else v
        self._last, self.facts = (states, S, v), Facts(solution.accepted, solution.kkt)
        self._u = self._limits.clip(self._v[0] * SCALE, self._u, TS)
        return self._u

    def _bounds(self, now: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds of the decisions, then of their changes, the first of which starts from ``now`` (4,)."""
        bounds = np.tile(self._limits.bounds / SCALE, self.steps)
        change = np.tile(self._limits.rates * self.h / SCALE, self.steps)
        upper, lower = np.concatenate([bounds, change]), -np.concatenate([bounds, change])
        first = slice(4 * self.steps, 4 * self.steps + 4)
        upper[first] += now
        lower[first] += now
        return upper, lower

    def _once(self, x: FloatArray, now: FloatArray) -> Prediction:
        """Linearised at ``x`` and ``now``, both held, over the whole horizon."""
        N = self.steps
        after, A, B = (rows[0] for rows in self._steps(x[np.newaxis], now[np.newaxis]))
        states = np.empty((N + 1, 3))
        states[0] = x
        for k in range(N):
            states[k + 1] = after + A @ (states[k] - x)
        return Prediction(states, chained(np.broadcast_to(A, (N, 3, 3)), np.broadcast_to(B, (N, 3, 4))))

    def _rolled(self, x: FloatArray, v: FloatArray) -> Prediction:
        """Linearised at every step of the prediction under ``v`` (N, 4)."""
        states = np.empty((self.steps + 1, 3))
        states[0] = x
        for k in range(self.steps):
            states[k + 1] = self._flow(self._driven, states[k], v[k] * SCALE)
        _, A, B = self._steps(states[:-1], v)
        return Prediction(states, chained(A, B))

    def _steps(self, x: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The states (n, 3) one step later, and their derivatives by ``x`` (n, 3, 3) and ``v`` (n, 3, 4)."""
        e = DIFFERENCE
        moves = np.concatenate([np.zeros((1, 7)), e * np.eye(7), -e * np.eye(7)])
        after = self._flow(self._plant.rhs, x[:, np.newaxis] + moves[:, :3], (v[:, np.newaxis] + moves[:, 3:]) * SCALE)
        J = (after[:, 1:8] - after[:, 8:]).swapaxes(1, 2) / (2 * e)
        return after[:, 0], J[..., :3], J[..., 3:]

    def _driven(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """The derivative of one state (3,) under ``u`` (4,): that of the plant, faster for one car."""
        return self._body.rhs(x, self._tyres.at(x, u) * self._tyres.scale)

    def _flow(self, rhs: Rhs, x: FloatArray, u: FloatArray) -> FloatArray:
        """The states (..., 3) one step later under ``u`` (..., 4)."""
        with np.errstate(over="ignore", invalid="ignore"):  # what leaves the numbers is not solved for
            for _ in range(SUBSTEPS):
                x = rk4_step(rhs, x, u, self.h / SUBSTEPS)
        return x


def chained(A: FloatArray, B: FloatArray) -> FloatArray:
    """The sensitivity (3 N, 4 N) of x_(k+1) = A_k x_k + B_k v_k, ``A`` (N, 3, 3) and ``B`` (N, 3, 4)."""
    N = len(A)
    S, so_far = np.zeros((N, 3, 4 * N)), np.zeros((3, 4 * N))
    for k in range(N):
        so_far = A[k] @ so_far
        so_far[:, 4 * k : 4 * k + 4] = B[k]
        S[k] = so_far
    return S.reshape(3 * N, 4 * N)
