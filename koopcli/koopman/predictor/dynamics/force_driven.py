"""ż = K z + (∂ψ/∂x) G ΔF: forces that act on the state act on its lift through the lift's derivative (7.23)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.predictor.lifts import Differentiable, Observables
from koopcli.progress import Progress
from koopcli.records import Array, BoolArray, Channels, FloatArray, Meta, Packed

InputMatrix = Literal["first", "every", "between", "relift"]
"""Where B = (∂ψ/∂x) G is taken: at the first state; again after every few samples, at the state predicted there, with z
kept; at both ends of such a stretch, of which the far one is predicted with the near one's B, and linear between them,
so that a sample within a stretch depends a little on the inputs of all of it; or after every sample, with the predicted
state lifted afresh.
"""
INPUT_MATRICES: tuple[str, ...] = get_args(InputMatrix)
STRETCHES = ("every", "between")
"""Those with stretches of a length that is told."""
TOGETHER = 1024  # trajectories whose lifted states are rolled together


@dataclass(frozen=True, eq=False, repr=False)
class ForceDriven(Diagonal):
    """z⁺ = A (z + dt/2 B u) + dt/2 B u with ``modes`` for A and B = (∂ψ/∂x) G of eq. (7.23).

    ``G`` (n_x, n_u): what an input of one changes in dx/dt, in units of the states over s and over those of the inputs;
    ``inputs`` is its n_u. ``input_matrix``: where B is taken; ``every``: samples of a stretch between two such places,
    where there are several. Without inputs it is what the modes alone predict, unless each sample is lifted afresh.
    """

    G: FloatArray
    input_matrix: InputMatrix = "every"
    every: int = 5

    kind: ClassVar[str] = "force-driven"
    about: ClassVar[str] = "linear by rates, driven by forces"

    @property
    def acting(self) -> BoolArray:
        """Which inputs change the derivative of the state."""
        return np.asarray(self.G.any(axis=0))

    def predict(
        self, lift: Observables, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress
    ) -> FloatArray:
        """C z_k, for ``TOGETHER`` trajectories at a time."""
        smooth = differentiable(lift)
        if not u.any() and self.input_matrix != "relift":
            return super().predict(lift, C, x0, u, progress)
        n, steps, _ = u.shape
        x = np.empty((n, steps + 1, len(C)))
        length = {"first": max(steps, 1), "relift": 1}.get(self.input_matrix, self.every)
        for start in range(0, n, TOGETHER):
            rows = slice(start, start + TOGETHER)
            z, B = self._driven_at(smooth, x0[rows])
            x[rows, 0] = z @ C.T
            for k in range(0, steps, length):
                on = slice(k, k + length)
                if k and self.input_matrix == "relift":
                    z, B = self._driven_at(smooth, x[rows, k])
                elif k and self.input_matrix == "every":
                    B = self._driven_at(smooth, x[rows, k])[1]
                end = B
                if self.input_matrix == "between":
                    end = self._driven_at(smooth, self._stretch(z, B, B, u[rows, on])[-1] @ C.T)[1]
                reached = self._stretch(z, B, end, u[rows, on])
                x[rows, k + 1 : k + 1 + length] = (reached @ C.T).transpose(1, 0, 2)
                z, B = reached[-1], end
                progress(start * steps + min(k + length, steps) * len(z), n * steps)
        return x

    def stepper(self, lift: Observables, C: FloatArray) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """C z⁺ with z = ψ(x) and B at x."""
        smooth = differentiable(lift)

        def step(x: FloatArray, u: FloatArray) -> FloatArray:
            z, B = self._driven_at(smooth, x)
            return np.asarray(self._stretch(z, B, B, u[:, np.newaxis])[-1] @ C.T)

        return step

    def input_matrices(self, lift: Observables, x: FloatArray) -> FloatArray:
        """B (n, N, n_u) at the states ``x`` (n, n_x), in 1/s over the units of the inputs."""
        return self._driven_at(differentiable(lift), x)[1]

    def _driven_at(self, lift: Differentiable, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """ψ (n, N) and B (n, N, n_u) at ``x`` (n, n_x)."""
        z, slopes = lift.with_slopes(x)
        return z, np.asarray(slopes @ self.G)

    def _stretch(self, z: FloatArray, B: FloatArray, end: FloatArray, u: FloatArray) -> FloatArray:
        """The lifted states (steps, n, N) that follow ``z`` (n, N) under ``u`` (n, steps, n_u), with an input matrix
        that goes from ``B`` to ``end`` (n, N, n_u).
        """
        steps = u.shape[1]
        reached = np.empty((steps, *z.shape))
        for j in range(steps):
            before = after = _times(B, u[:, j])
            if end is not B:
                change = _times(end, u[:, j]) - before
                before, after = before + j / steps * change, before + (j + 1) / steps * change
            half = self.modes.dt / 2
            z = (self.modes @ (z + half * before).T).T + half * after
            reached[j] = z
        return reached

    def pack(self, inputs: Channels) -> Packed:
        """The modes, G, and where B is taken."""
        modes = super().pack(inputs)
        units = ", ".join(f"per second of a state/({unit})" for unit in inputs.units)
        meta: Meta = {**modes.meta, "input_matrix": self.input_matrix}
        if self.input_matrix in STRETCHES:
            meta["every"] = self.every
        return Packed({**modes.arrays, "G": Array(self.G, ("state_changed", "input"), units)}, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> ForceDriven:
        """The inverse of :meth:`pack`."""
        coasting, meta = Diagonal.unpack(packed), packed.meta
        where = {"every": meta["every"]} if "every" in meta else {}
        return cls(coasting.modes, coasting.inputs, packed.arrays["G"].values[...], meta["input_matrix"], **where)


def _times(B: FloatArray, u: FloatArray) -> FloatArray:
    """``B`` (n, N, n_u) times ``u`` (n, n_u), (n, N)."""
    return np.asarray(np.matmul(B, u[..., np.newaxis])[..., 0])


def differentiable(lift: Observables) -> Differentiable:
    """The ``lift``, which has a derivative. Raises ``InvalidValueError`` for one without."""
    if not isinstance(lift, Differentiable):
        raise InvalidValueError(
            f"force inputs need the derivative of the lift, and '{type(lift).__name__}' has none: fit with fit-eigen, "
            "the window 'horizon' and the lift 'polyharmonic' (the experiments best-eigen and quick-eigen)"
        )
    return lift
