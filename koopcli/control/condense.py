"""Predicted states over a horizon, and what each force of a plan does to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from koopcli.control.tyres import FRONT, REAR, Tyres
from koopcli.records import FloatArray

ORDER = 6  # of Taylor's series of a prediction step

Lift = Callable[[FloatArray], FloatArray]
Future = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From a state (n_x,) to what follows it (samples, n_x), and to the derivative of that by it (samples, n_x, n_x)."""


class Prediction(NamedTuple):
    """Predicted ``states`` (N + 1, 3), and ``sensitivity`` (3 N, 4 N): the derivatives of states 1 to N by the plan."""

    states: FloatArray
    sensitivity: FloatArray


class Response(Protocol):
    """How the body answers to axle forces."""

    def __call__(self, x: FloatArray, v: FloatArray) -> Prediction:
        """The prediction from ``x`` (3,) under the plan ``v`` (N, 4), forces divided by F_m."""


def toeplitz(blocks: FloatArray) -> FloatArray:
    """The sensitivity (n_x N, n_u N) of a system whose answer to input j at sample k is ``blocks[k - 1 - j]``.

    ``blocks`` (N, n_x, n_u).
    """
    N, n_x, n_u = blocks.shape
    S = np.zeros((N, n_x, N, n_u))
    for j in range(N):
        S[j:, :, j] = blocks[: N - j]
    return S.reshape(n_x * N, n_u * N)


@dataclass(frozen=True, eq=False)
class GeneratorResponse:
    """z_(k+1) = e^(h K(v_k)) z_k with K(v) = K_0 + Σ_i v_i K_i, by Taylor's series to order 6, and its derivatives.

    ``lift`` takes states (n, 3) to (n, m); ``K`` (5, m, m) in 1/s of forces divided by F_m; ``C`` (3, m); ``h`` in s.
    """

    lift: Lift
    K: FloatArray
    C: FloatArray
    h: float

    def __call__(self, x: FloatArray, v: FloatArray) -> Prediction:
        """States and sensitivity, shapes as in :class:`Response`."""
        N, m = len(v), self.K.shape[1]
        K = self._constant + (v @ self._flat).reshape(N, m, m)
        onward = _exponentials(K)
        z = np.empty((N + 1, m))
        z[0] = self.lift(x[np.newaxis])[0]
        for k in range(N):
            z[k + 1] = onward[k] @ z[k]
        driven = self._driven(K, z[:N])
        S = np.zeros((N, 3, N, 4))
        rows = self.C  # C times the exponentials between an input and each later sample
        for j in range(N - 1, -1, -1):
            S[j:, :, j] = (rows @ driven[j]).reshape(-1, 3, 4)
            if j:
                rows = np.concatenate([self.C, rows @ onward[j]])
        states = z @ self.C.T
        states[0] = x
        return Prediction(states, S.reshape(3 * N, 4 * N))

    def _driven(self, K: FloatArray, z: FloatArray) -> FloatArray:
        """d z_(k+1) / d v_k (N, m, 4): the series y_j = (h K / j) y_(j-1), differentiated term by term."""
        N, m = z.shape
        y = np.empty((ORDER, N, m))
        y[0] = z
        for j in range(1, ORDER):
            y[j] = np.matmul(K, y[j - 1][..., np.newaxis])[..., 0] / j
        every = self._stacked @ y.reshape(-1, m).T  # every K_i times every term
        acting = np.ascontiguousarray(every.reshape(4, m, ORDER, N).transpose(2, 3, 1, 0))
        term = acting[0]
        total = term.copy()
        for j in range(2, ORDER + 1):
            term = np.matmul(K, term)
            term += acting[j - 1]
            term /= j
            total += term
        return np.asarray(total)

    @cached_property
    def _constant(self) -> FloatArray:
        return np.asarray(self.h * self.K[0])

    @cached_property
    def _flat(self) -> FloatArray:
        return np.ascontiguousarray(self.h * self.K[1:].reshape(4, -1))

    @cached_property
    def _stacked(self) -> FloatArray:
        return np.ascontiguousarray(self.h * self.K[1:].reshape(-1, self.K.shape[2]))


def _exponentials(K: FloatArray) -> FloatArray:
    """e^K (N, m, m) to order 6 by three products."""
    K2 = K @ K
    K3 = K2 @ K
    series = K3 @ (K / 24 + K2 / 120 + K3 / 720)
    series += K
    series += K2 / 2
    series += K3 / 6
    diagonal = np.einsum("kii->ki", series)
    diagonal += 1.0
    return np.asarray(series)


@dataclass(frozen=True, eq=False)
class EigenResponse:
    """z_(k+1) = A^q z_k + B (v_k - F_0(x_k) / F_m), z_0 = ψ(x), with B = S (∂ψ/∂x)(x) G diag(F_m) frozen.

    ``future``: what ψ is projected from, and its derivative; ``seen`` (2 N + 1, 3, 3 samples): C A^(qk) times that
    projection for k = 0 .. N, then C A^(qk) S times it for k = 0 .. N - 1, so lifted states are never formed.
    ``coasting``: the tyres of the car on which ψ was fitted; F_0 are their forces at zero steer and slip, whose
    dependence on x is left out of the sensitivity. ``body`` (3, 4): G diag(F_m).
    """

    future: Future
    seen: FloatArray
    coasting: Tyres
    body: FloatArray

    def __call__(self, x: FloatArray, v: FloatArray) -> Prediction:
        """States and sensitivity, shapes as in :class:`Response`."""
        N = len(v)
        states_ahead, by_x = self.future(x)
        columns = np.concatenate([states_ahead[..., np.newaxis], by_x], axis=2).reshape(-1, 4)
        out = (self._rows @ columns).reshape(len(self.seen), 3, 4)
        blocks = out[N + 1 :, :, 1:] @ self.body
        S = toeplitz(blocks)
        states = np.empty((N + 1, 3))
        states[0] = x
        states[1:] = out[1 : N + 1, :, 0] + (S @ v.ravel()).reshape(N, 3)
        for k in range(N):
            front, rear = self._coasting(states[k])
            states[k + 1 :] -= blocks[: N - k, :, 1] * front + blocks[: N - k, :, 3] * rear
        return Prediction(states, S)

    def _coasting(self, x: FloatArray) -> tuple[float, float]:
        """The lateral forces / F_m of both axles at zero steer and slip; the longitudinal ones are zero."""
        v_x, v_y, yaw_rate = x.tolist()
        arms, force = self.coasting.arms, self.coasting.of_axle
        front = force(FRONT, v_x, v_y + arms[FRONT] * yaw_rate, 0.0, 0.0)
        return front[1], force(REAR, v_x, v_y + arms[REAR] * yaw_rate, 0.0, 0.0)[1]

    @cached_property
    def _rows(self) -> FloatArray:
        return np.ascontiguousarray(self.seen.reshape(-1, self.seen.shape[2]))


def eigen_rows(block: FloatArray, C: FloatArray, projection: FloatArray, dt: float, q: int, steps: int) -> FloatArray:
    """``seen`` of :class:`EigenResponse` (2 steps + 1, 3, 3 samples), for ``steps`` of ``q`` samples of ``dt`` s each.

    ``block`` (L, L): A of the lifted states of one state of the plant; ``C`` (3, 3 L); ``projection`` (L, samples).
    S = Σ_(j < q) A^j (A + 1) dt / 2: half of an input before each sample's step, and half after it.
    """
    L, n_x = len(block), len(C)
    identity = np.eye(L)
    step = np.linalg.matrix_power(block, q)
    summed = sum((np.linalg.matrix_power(block, j) for j in range(q)), np.zeros((L, L)))
    S = summed @ (block + identity) * dt / 2
    rows = [C.reshape(n_x, -1, L)]  # (3, copies, L)
    for _ in range(steps):
        rows.append(rows[-1] @ step)
    free = np.array(rows)
    every = np.concatenate([free, free[:steps] @ S]) @ projection  # (2 N + 1, 3, copies, samples)
    return np.ascontiguousarray(every.swapaxes(2, 3).reshape(2 * steps + 1, n_x, -1))


@dataclass(frozen=True, eq=False)
class RolledResponse:
    """Any ``step`` of the body, rolled out, with central differences: what predictors are measured against.

    ``step``: from states (n, 3) and forces / F_m (n, 4) to the states one prediction step later.
    """

    step: Callable[[FloatArray, FloatArray], FloatArray]
    difference: float = 1e-5

    def __call__(self, x: FloatArray, v: FloatArray) -> Prediction:
        """States and sensitivity, shapes as in :class:`Response`."""
        N, e = len(v), self.difference
        moves = np.concatenate([np.zeros((1, 7)), e * np.eye(7), -e * np.eye(7)])
        states = np.empty((N + 1, 3))
        states[0] = x
        S = np.zeros((N, 3, 4 * N))
        so_far = np.zeros((3, 4 * N))
        for k in range(N):
            after = self.step(states[k] + moves[:, :3], v[k] + moves[:, 3:])
            J = (after[1:8] - after[8:]).T / (2 * e)
            so_far = J[:, :3] @ so_far
            so_far[:, 4 * k : 4 * k + 4] = J[:, 3:]
            states[k + 1], S[k] = after[0], so_far
        return Prediction(states, S.reshape(3 * N, 4 * N))
