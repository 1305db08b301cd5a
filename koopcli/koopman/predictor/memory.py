"""A lift that remembers: observables of the present state, beside past states and inputs as they were."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from koopcli.content import Content
from koopcli.koopman.predictor.lifts import Explicit, Observed
from koopcli.records import FloatArray, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Memory(Content):
    """z = [ψ(x_k), x_{k-1}, …, x_{k-p}, u_{k-1}, …, u_{k-p}] with ψ the ``present`` basis and p ``memory`` steps.

    It is a lift of the augmented state X = [x_k, past x, past u] (n, n_x + p (n_x + n_u)), newest first, of so many
    ``states`` n_x and ``inputs`` n_u.
    """

    present: Explicit
    memory: int
    states: int
    inputs: int

    stored: ClassVar[str] = "memory"

    @property
    def past(self) -> int:
        """Past states and inputs, p (n_x + n_u)."""
        return self.memory * (self.states + self.inputs)

    @property
    def width(self) -> int:
        """Entries of an augmented state."""
        return self.states + self.past

    @property
    def functions(self) -> int:
        """Dimension of z."""
        return self.present.functions + self.past

    @property
    def constant(self) -> int | None:
        """Index of the observable that is one everywhere, if there is one."""
        return self.present.constant

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x_k = C z."""
        return np.hstack([self.present.state_map, np.zeros((self.states, self.past))])

    def lift(self, x: FloatArray) -> FloatArray:
        """z (n, N) of the augmented states (n, n_x + p (n_x + n_u))."""
        x = np.asarray(x, dtype=float)
        return np.hstack([self.present.lift(x[:, : self.states]), x[:, self.states :]])

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · z as (n, R), for ``rows`` (R, N) and augmented states ``x``."""
        functions = self.present.functions
        now = self.present.observe(x[:, : self.states], rows[:, :functions])
        return np.asarray(now + x[:, self.states :] @ rows[:, functions:].T)

    def onto(self, rows: FloatArray) -> Observed:
        """The function of augmented states that observes ``rows`` (R, N)."""
        return partial(self.observe, rows=rows)

    def augmented(self, x: FloatArray, past_x: FloatArray, past_u: FloatArray) -> FloatArray:
        """X (n, n_x + p (n_x + n_u)) of ``x`` (n, n_x) with ``past_x`` (n, p, n_x), ``past_u`` (n, p, n_u)."""
        return np.hstack([x, flat(past_x), flat(past_u)])

    def onward(self, x: FloatArray, u: FloatArray, x_next: FloatArray) -> FloatArray:
        """The next augmented state, (n, n_x + p (n_x + n_u)), of ``x`` under ``u`` (n, n_u) with the ``x_next``."""
        split = self.states * (1 + self.memory)
        states, inputs = x[:, : split - self.states], x[:, split : x.shape[1] - self.inputs]
        return np.hstack([x_next, states, u, inputs])

    def pack(self) -> Packed:
        """The present basis, and how far back the rest goes."""
        present = self.present.pack()
        arrays = {f"present/{name}": array for name, array in present.arrays.items()}
        sizes = {"memory": self.memory, "states": self.states, "inputs": self.inputs}
        return Packed(arrays, {"kind": self.stored, **sizes, "present": present.meta})

    @classmethod
    def unpack(cls, packed: Packed, bases: Mapping[str, Callable[[Packed], Any]]) -> Memory:
        """The inverse of :meth:`pack`; ``bases`` reads a basis of each kind."""
        meta = packed.meta
        present = bases[meta["present"]["kind"]](Packed(packed.below("present/"), meta["present"]))
        return cls(present, meta["memory"], meta["states"], meta["inputs"])


def flat(past: FloatArray) -> FloatArray:
    """What was at each of p steps, (n, p, k), as one row each, (n, p k)."""
    return past.reshape(past.shape[0], past.shape[1] * past.shape[2])
