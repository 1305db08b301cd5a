"""The receding horizon on axle forces that E, F and the equations share (steps 1 to 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.control import qp
from koopcli.control.attainable import Attainable
from koopcli.control.condense import Response
from koopcli.control.control import FREE, TS, Facts, Plan, checked
from koopcli.control.limits import Limits
from koopcli.control.realise import Inverse
from koopcli.control.tyres import Tyres
from koopcli.records import FloatArray


@dataclass(frozen=True)
class Costs:
    """``state``: weights of squared errors of v_x, v_y and yaw rate; ``last``: how many times over at the end;
    ``effort`` of |v|² by time, ``change`` of |v_k - v_(k-1)|².
    """

    state: tuple[float, float, float]
    last: float = 5.0
    effort: float = 1e-3
    change: float = 2e-3


def quadratic(costs: Costs, steps: int, h: float) -> tuple[FloatArray, FloatArray]:
    """The constant parts of a cost: roots of the state weights (3 steps,), and the Hessian of the inputs' (4 steps,
    4 steps), for ½ vᵀ H v.
    """
    weights = h * np.tile(costs.state, (steps, 1))
    weights[-1] *= costs.last
    D = np.eye(4 * steps) - np.eye(4 * steps, k=-4)
    return np.sqrt(weights.ravel()), costs.effort * h * np.eye(4 * steps) + costs.change * D.T @ D


class Planner:
    """One car under control: it keeps its last plan ``v`` (N, 4) and the inputs ``u`` (4,) it asked for last.

    ``response`` predicts; ``tyres`` and ``limits`` are what the controller knows; N ``steps`` of ``h`` s.
    """

    def __init__(
        self, response: Response, tyres: Tyres, limits: Limits, attainable: Attainable, inverse: Inverse, costs: Costs
    ) -> None:
        qp.daqp()
        self.steps, self.h = attainable.steps, attainable.h
        self.times: FloatArray = np.asarray(self.h * np.arange(1.0, self.steps + 1))
        self._response, self._tyres, self._limits = response, tyres, limits
        self._attainable, self._inverse, self._change = attainable, inverse, costs.change
        self._root, self._smooth = quadratic(costs, self.steps, self.h)
        self.reset()

    def reset(self) -> None:
        """Forget the plan: the next step is the first one, at zero steer and slip."""
        self._v, self._u = np.zeros((self.steps, 4)), np.zeros(4)
        self._last: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self.facts = FREE

    @property
    def plan(self) -> Plan | None:
        """The prediction under the plan of the last step, forces in N; None before the first."""
        if self._last is None:
            return None
        states, S, before = self._last
        moved = (S @ (self._v - before).ravel()).reshape(-1, 3)
        return Plan(
            np.concatenate([[0.0], self.times]),
            states + np.concatenate([np.zeros((1, 3)), moved]),
            self._v * self._tyres.scale,
        )

    def step(self, x: FloatArray, reference: FloatArray) -> FloatArray:
        """Inputs (4,) to hold for the next sample, at ``x`` (3,) with the ``reference`` at ``times`` (N, 3), or (3,).

        Raises ``InvalidValueError`` for shapes that do not fit and a state that is not finite.
        """
        x, reference = checked(x, reference, self.steps)
        v = self._v.copy()
        v[:-1] += (TS / self.h) * (v[1:] - v[:-1])
        states, S = self._response(x, v)
        weighted = S * self._root[:, np.newaxis]
        error = self._root * (states[1:] - reference).ravel() - weighted @ v.ravel()
        H = weighted.T @ weighted + self._smooth
        f = weighted.T @ error
        f[:4] -= self._change * self._tyres.at(x, self._u)
        upper = self._attainable.support(states[:-1], self._u).ravel()
        solution = qp.solve(H, f, self._attainable.rows, upper)
        self._v = solution.point.reshape(self.steps, 4) if solution.accepted else v
        self._last, self.facts = (states, S, v), Facts(solution.accepted, solution.kkt)
        self._u = self._limits.clip(self._inverse(x, self._u, self._v[0]), self._u, TS)
        return self._u
