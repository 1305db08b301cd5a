"""Thin-plate splines, as observables of EDMD and as boundary functions of eigenfunctions (docs/equations.md 3, 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from koopcli.choices import SEED_LIMIT, setting
from koopcli.content import Content
from koopcli.errors import InvalidValueError
from koopcli.koopman.bases.basis import BasisChoice
from koopcli.koopman.predictor.lifts import Observed
from koopcli.records import OF_STATES, Array, FloatArray, Packed

ROUNDS = 30  # of k-means; the centres need not be converged


def thin_plate(x: FloatArray, centres: FloatArray, scale: FloatArray) -> FloatArray:
    """r² log r with r the distance in ``scale``d coordinates (3.4), (7.5), 0 at 0: (n, centres)."""
    r2 = np.zeros((len(x), len(centres)))
    for i in range(x.shape[1]):
        r2 += ((x[:, i, np.newaxis] - centres[:, i]) / scale[i]) ** 2
    return np.asarray(0.5 * r2 * np.log(np.where(r2 > 0, r2, 1.0)))


def draw_centres(x: FloatArray, count: int, seed: int) -> FloatArray:
    """``count`` points (count, n_x), normal with the mean and the standard deviation of all samples of ``x``."""
    flat = x.reshape(-1, x.shape[-1])
    drawn = np.random.default_rng(seed).standard_normal((count, flat.shape[1]))
    return np.asarray(flat.mean(axis=0) + flat.std(axis=0) * drawn)


def _k_means(x: FloatArray, count: int, seed: int) -> FloatArray:
    """Centres (count, n_x) of as many clusters of the different states ``x`` (n, n_x)."""
    from scipy.cluster.vq import kmeans2  # noqa: PLC0415  (a fit without splines goes without)

    if count > len(x):
        raise InvalidValueError(
            f"{count} centres cannot be the means of {len(x)} different states: lower fit-edmd.centres or sample more"
        )
    centres, _ = kmeans2(x, count, iter=ROUNDS, minit="++", missing="raise", seed=np.random.default_rng(seed))
    return np.asarray(centres)


PLACEMENTS: dict[str, Callable[[FloatArray, int, int], FloatArray]] = {"k-means": _k_means, "drawn": draw_centres}


@dataclass(frozen=True, eq=False, repr=False)
class ThinPlate(Content):
    """1, the states, and r² log r about ``centres`` (M, n_x), in half-widths ``scale`` (n_x,) from the ``middle``.

    The constant and the states stand for what splines cannot say exactly; they come first.
    """

    middle: FloatArray
    scale: FloatArray
    centres: FloatArray

    stored: ClassVar[str] = "thin-plate"
    constant: ClassVar[int] = 0
    products: ClassVar[None] = None

    @property
    def functions(self) -> int:
        """Number of observables."""
        return 1 + len(self.scale) + len(self.centres)

    @property
    def state_map(self) -> FloatArray:
        """C (n_x, N) with x = C ψ(x)."""
        n_x = len(self.scale)
        C = np.zeros((n_x, self.functions))
        C[:, 0], C[:, 1 : 1 + n_x] = self.middle, np.diag(self.scale)
        return C

    def lift(self, x: FloatArray) -> FloatArray:
        """ψ(x) (n, N) of the states (n, n_x)."""
        scaled = (x - self.middle) / self.scale
        return np.hstack([np.ones((len(x), 1)), scaled, thin_plate(x, self.centres, self.scale)])

    def lift_rows(self, x: FloatArray, out: FloatArray) -> None:
        """ψ(x) of the states (n, n_x) as rows into ``out`` (N, n)."""
        out[:] = self.lift(x).T

    def observe(self, x: FloatArray, rows: FloatArray) -> FloatArray:
        """rows · ψ(x) as (n, R), for ``rows`` (R, N)."""
        return self.lift(x) @ rows.T

    def onto(self, rows: FloatArray) -> Observed:
        """The function of ``x`` (n, n_x) that observes ``rows`` (R, N)."""
        return partial(self.observe, rows=rows)

    def group_moments(self, x: FloatArray, weights: FloatArray) -> FloatArray:
        """Σ_j weights[j] ψ(x[s, j]) as (n, q, N), for states in groups (n, m, n_x) and weights (m, q)."""
        z = self.lift(x.reshape(-1, x.shape[-1])).reshape(*x.shape[:2], -1)
        return np.asarray(np.matmul(weights.T, z))

    def pack(self) -> Packed:
        """The centres and the scaling."""
        arrays = {
            "middle": Array(self.middle, ("state",), OF_STATES),
            "scale": Array(self.scale, ("state",), OF_STATES),
            "centres": Array(self.centres, ("centre", "state"), OF_STATES),
        }
        return Packed(arrays, {"kind": self.stored})

    @classmethod
    def unpack(cls, packed: Packed) -> ThinPlate:
        """The inverse of :meth:`pack`."""
        return cls(**{name: array.values[...] for name, array in packed.arrays.items()})


@dataclass(frozen=True)
class Splines(BasisChoice):
    """Thin-plate splines, with a constant and the states."""

    kind: ClassVar[str] = "thin-plate"
    makes = ThinPlate
    sized_by, of_states = "centres", True
    centres: int = setting(500, low=1, high=100_000, option=True, help="number of splines")
    placement: Literal["k-means", "drawn"] = setting(
        "k-means",
        option=True,
        help="centres at the means of clusters of the data, or drawn from a normal distribution with its mean and "
        "spread",
    )
    seed: int = setting(0, low=0, high=SEED_LIMIT, help="seed of the centres")

    @property
    def name(self) -> str:
        """What an EDMD predictor with it is called."""
        return f"EDMD, {self.centres} splines"

    @property
    def seconds(self) -> float:
        """About how long one state takes to be lifted."""
        return 1e-8 * self.centres

    def functions(self, states: int) -> int:
        """Number of observables of so many ``states``."""
        return 1 + states + self.centres

    def make(self, x: FloatArray, *, raw: bool = False) -> ThinPlate:
        """The basis on the training states ``x`` (n, n_x); distances are in half-widths of their box."""
        low, high = x.min(axis=0), x.max(axis=0)
        half = (high - low) / 2
        scale = np.where(half > 0, half, 1.0)
        middle = (high + low) / 2
        distinct = np.unique(x, axis=0)
        placed = PLACEMENTS[self.placement]((distinct - middle) / scale, self.centres, self.seed)
        return ThinPlate(middle, scale, middle + scale * placed)
