"""What a regression sums over the samples, as passes that any number of processes can share (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from koopcli.koopman.bases import STORED
from koopcli.koopman.bases.basis import Basis
from koopcli.koopman.bases.moments import Products
from koopcli.koopman.edmd.inputs import WhiteInputs
from koopcli.koopman.edmd.passes import Found
from koopcli.koopman.edmd.regression import Normal, add_rows
from koopcli.koopman.edmd.transitions import Transitions
from koopcli.progress import Progress
from koopcli.records import Array, FloatArray, Packed

READ = 1 << 14  # samples read together
LIFTED = 1 << 21  # numbers of lifted states and regressors that are held together
ROWS = (1 << 10, READ)  # the fewest samples lifted together, and the most
WORTH = 8  # so many times fewer moments than entries of the Gram matrix, or they are no gain


class Layout(NamedTuple):
    """Where the columns of a regression stand: ψ(x) first, then ``inputs`` of w itself, then products, if any."""

    functions: int
    inputs: int
    directions: int
    bilinear: bool

    @property
    def columns(self) -> int:
        """How many there are."""
        return self.functions * (1 + (self.directions if self.bilinear else 0)) + self.inputs


class Block(NamedTuple):
    """Columns ``V`` (columns, n) and targets ``Y`` = ψ(x⁺) (N, n) of some samples, as rows, and what they are of."""

    V: FloatArray
    Y: FloatArray
    x: FloatArray
    u: FloatArray


@dataclass(frozen=True)
class Regressors:
    """The columns [ψ(x), w] or [ψ(x), w ⊗ ψ(x)] of a fit, with ``inputs`` w of mean square I; w itself stands apart
    where it is not the product with a constant already.
    """

    basis: Basis
    inputs: WhiteInputs
    bilinear: bool

    @property
    def layout(self) -> Layout:
        """Where the columns stand."""
        r = self.inputs.T.shape[1]
        apart = self.basis.constant is None or not self.bilinear
        return Layout(self.basis.functions, r if apart else 0, r, self.bilinear)

    def columns(self, x: FloatArray, u: FloatArray, out: FloatArray) -> None:
        """The columns as rows into ``out`` (columns, n), for ``x`` (n, n_x) and ``u`` (n, n_u)."""
        functions, inputs, *_ = self.layout
        w = self.inputs(u).T
        self.basis.lift_rows(x, out[:functions])
        out[functions : functions + inputs] = w[:inputs]
        if self.bilinear:
            products = out[functions + inputs :].reshape(len(w), functions, len(x))
            np.multiply(w[:, np.newaxis], out[:functions], out=products)

    def blocks(self, data: Transitions, span: slice, progress: Progress) -> Iterator[Block]:
        """One block of samples after another; the next one overwrites the arrays of the last."""
        functions, columns = self.basis.functions, self.layout.columns
        most = min(max(LIFTED // (columns + functions), ROWS[0]), ROWS[1])
        rows = -(-READ // -(-READ // most))  # alike, since few rows at a time cost more each
        room, beside = np.empty(columns * rows), np.empty(functions * rows)
        done, total = 0, span.stop - span.start
        for x, u, x_next in data.blocks(READ, span):
            for start in range(0, len(x), rows):
                part = slice(start, start + rows)
                n = len(x[part])
                V, Y = room[: columns * n].reshape(columns, n), beside[: functions * n].reshape(functions, n)
                self.columns(x[part], u[part], V)
                self.basis.lift_rows(x_next[part], Y)
                yield Block(V, Y, x[part], u[part])
            done += len(x)
            progress(done, total)

    def pack(self) -> Packed:
        """The basis and the inputs for another process."""
        basis, inputs = self.basis.pack(), self.inputs.pack()
        arrays = {f"basis/{name}": array for name, array in basis.arrays.items()}
        arrays |= {f"inputs/{name}": array for name, array in inputs.arrays.items()}
        return Packed(arrays, {"basis": basis.meta, "bilinear": self.bilinear})

    @classmethod
    def unpack(cls, packed: Packed) -> Regressors:
        """The inverse of :meth:`pack`."""
        basis = Packed(packed.below("basis/"), packed.meta["basis"])
        inputs = WhiteInputs.unpack(Packed(packed.below("inputs/")))
        return cls(STORED[basis.meta["kind"]](basis), inputs, packed.meta["bilinear"])


@dataclass(frozen=True)
class Sum:
    """The pass that sums V Vᵀ and V Yᵀ; ``by_moments`` says how V Vᵀ is summed."""

    of: Regressors
    by_moments: bool = False

    @property
    def bytes(self) -> float:
        """Those of both sums."""
        layout = self.of.layout
        return 8.0 * layout.columns * (layout.columns + layout.functions)

    def __call__(self, data: Transitions, span: slice, progress: Progress) -> Found:
        """Both sums over the samples of ``span``, their number, and what the moments have lost of V Vᵀ."""
        layout = self.of.layout
        gram: _Gram | _Direct = _Gram.of(self.of) if self.by_moments else _Direct(layout.columns)
        cross = np.zeros((layout.columns, layout.functions))
        product = np.empty_like(cross)
        rows = 0
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused by whoever solves
            for block in self.of.blocks(data, span, progress):
                gram.add(block)
                cross += np.matmul(block.V, block.Y.T, out=product)
                rows += len(block.x)
            total, lost = gram.total()
        return {"gram": total, "cross": cross, "rows": np.array([rows]), "lost": np.array([lost])}

    def pack(self) -> Packed:
        """The regressors, and the way."""
        packed = self.of.pack()
        return Packed(packed.arrays, {**packed.meta, "kind": "sum", "by_moments": self.by_moments})

    @classmethod
    def unpack(cls, packed: Packed) -> Sum:
        """The inverse of :meth:`pack`."""
        return cls(Regressors.unpack(packed), packed.meta["by_moments"])


@dataclass(frozen=True)
class Triangle:
    """The pass that keeps the R of a QR factorisation of the rows [V / ``scale``, Y]."""

    of: Regressors
    scale: FloatArray

    @property
    def bytes(self) -> float:
        """Those of a square."""
        return 8.0 * (self.of.layout.columns + self.of.layout.functions) ** 2

    def __call__(self, data: Transitions, span: slice, progress: Progress) -> Found:
        """That R over the samples of ``span``."""
        triangle = np.empty((0, len(self.scale) + self.of.basis.functions))
        waiting: list[FloatArray] = []
        held = 0
        for V, Y, _, _ in self.of.blocks(data, span, progress):
            waiting.append(np.hstack([V.T / self.scale, Y.T]))
            held += len(waiting[-1])
            if held >= 4 * triangle.shape[1]:  # of few rows most of the work would be the triangle again
                triangle, waiting, held = add_rows(triangle, *waiting), [], 0
        return {"triangle": add_rows(triangle, *waiting)}

    def pack(self) -> Packed:
        """The regressors and the scale."""
        packed = self.of.pack()
        arrays = {**packed.arrays, "scale": Array(self.scale, ("column",), "1")}
        return Packed(arrays, {**packed.meta, "kind": "triangle"})

    @classmethod
    def unpack(cls, packed: Packed) -> Triangle:
        """The inverse of :meth:`pack`."""
        return cls(Regressors.unpack(packed), packed.arrays["scale"].values[...])


def together(parts: Iterable[Found]) -> Normal:
    """The sums over all samples, from those of consecutive parts."""
    gram = cross = None
    rows, lost = 0, 0.0
    for part in parts:
        gram = part["gram"] if gram is None else gram + part["gram"]
        cross = part["cross"] if cross is None else cross + part["cross"]
        rows, lost = rows + int(part["rows"][0]), max(lost, float(part["lost"][0]))
    assert gram is not None, "there is at least one part"
    assert cross is not None, "there is at least one part"
    return Normal(gram, cross, rows, lost)


def moments_pay(of: Regressors) -> bool:
    """Whether the Gram matrix comes cheaper by moments."""
    products, layout = of.basis.products, of.layout
    return products is not None and WORTH * products.moments * len(_pairs(layout)) <= layout.columns**2


def lost_by(gram: FloatArray, direct: FloatArray) -> float:
    """How far a Gram matrix is from the one summed entry by entry, for columns of norm one."""
    length = np.sqrt(np.where(np.diag(direct) > 0, np.diag(direct), 1.0))
    return float(np.abs((gram - direct) / np.outer(length, length)).max())


class _Direct:
    """V Vᵀ entry by entry."""

    def __init__(self, columns: int) -> None:
        self._sum = np.zeros((columns, columns))
        self._product = np.empty_like(self._sum)

    def add(self, block: Block) -> None:
        """More samples."""
        self._sum += np.matmul(block.V, block.V.T, out=self._product)

    def total(self) -> tuple[FloatArray, float]:
        """The sum; nothing is lost."""
        return self._sum, 0.0


@dataclass
class _Gram:
    """V Vᵀ by moments, beside that of its first block entry by entry, which says how many digits they lose."""

    products: Products
    inputs: WhiteInputs
    layout: Layout
    sums: FloatArray | float = 0.0
    mixed: FloatArray | float = 0.0
    lost: float | None = None

    @classmethod
    def of(cls, regressors: Regressors) -> _Gram:
        """Nothing summed yet."""
        products = regressors.basis.products
        assert products is not None, "only of a basis that has them"
        return cls(products, regressors.inputs, regressors.layout)

    def add(self, block: Block) -> None:
        """More samples."""
        V, x = block.V, block.x
        w = np.vstack([np.ones(len(x)), self.inputs(block.u).T])
        sums = self.products.sums(x, np.stack([w[p] * w[q] for p, q in _pairs(self.layout)]))
        beside = V[self.layout.functions :] if self.layout.inputs else V[:0]
        mixed = beside @ V.T
        if self.lost is None:
            direct = V @ V.T
            self.lost = lost_by(self._whole(sums, mixed), direct)
        self.sums, self.mixed = self.sums + sums, self.mixed + mixed

    def total(self) -> tuple[FloatArray, float]:
        """The sum, and what the moments have lost of its scaled entries."""
        assert isinstance(self.sums, np.ndarray), "there is at least one block"
        assert isinstance(self.mixed, np.ndarray), "there is at least one block"
        assert self.lost is not None, "there is at least one block"
        return self._whole(self.sums, self.mixed), self.lost

    def _whole(self, sums: FloatArray, mixed: FloatArray) -> FloatArray:
        """V Vᵀ from the weighted sums of moments, and the rows of the inputs that stand apart."""
        N, columns = self.layout.functions, self.layout.columns
        gram = np.empty((columns, columns))
        for (p, q), block in zip(_pairs(self.layout), self.products.gram(sums), strict=True):
            even = (block + block.T) / 2  # what rounding makes of a symmetric matrix
            gram[p * N : (p + 1) * N, q * N : (q + 1) * N] = even
            gram[q * N : (q + 1) * N, p * N : (p + 1) * N] = even
        if len(mixed):
            gram[N:], gram[:, N:] = mixed, mixed.T
        return gram


def _pairs(layout: Layout) -> list[tuple[int, int]]:
    """Which products of 1, w_1, w_2, … weigh the blocks of the Gram matrix."""
    return list(combinations_with_replacement(range(1 + layout.directions), 2)) if layout.bilinear else [(0, 0)]
