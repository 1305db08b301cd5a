"""Blocks of a measured log: what a fit may see, and what is held out to judge it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import Episodes, IndexArray

DEALT = 12  # from so many runs on, whole runs are dealt out
MARGIN = 2.0  # s, cut off the training rows on either side of a held-out block
SHORT_MARGIN = 0.5  # s, the same of a short log
SHORT = 70.0  # s of rows, below which a log is short


@dataclass(frozen=True)
class Piece:
    """Consecutive rows ``start`` to ``stop`` (exclusive) of one episode, which is from recording ``run``."""

    start: int
    stop: int
    run: int

    def __len__(self) -> int:
        return self.stop - self.start


Pieces = tuple[Piece, ...]


@dataclass(frozen=True)
class Fold:
    """A ``held`` block, and what a fit may be ``training`` on: no row of the block, and none close to it in time."""

    training: Pieces
    held: Pieces


def pieces_of(episodes: Episodes) -> Pieces:
    """The episodes of a log as pieces, each whole."""
    edges = zip(episodes.bounds[:-1].tolist(), episodes.bounds[1:].tolist(), episodes.runs.tolist(), strict=True)
    return tuple(Piece(start, stop, run) for start, stop, run in edges)


def row_numbers(pieces: Sequence[Piece]) -> IndexArray:
    """The rows of the pieces, (rows,), one piece after the other."""
    return joined([np.arange(piece.start, piece.stop) for piece in pieces])


def joined(rows: Sequence[np.ndarray]) -> IndexArray:
    """Row numbers one after the other; none where there are none."""
    return np.concatenate([np.empty(0, dtype=np.intp), *rows]).astype(np.intp)


def rows_of(pieces: Sequence[Piece]) -> int:
    """How many rows the pieces have together."""
    return sum(map(len, pieces))


@dataclass(frozen=True)
class Holding:
    """How blocks of a log are held out: whole runs ``dealt`` out in turn, or equal rows with a ``margin`` of rows."""

    dealt: bool
    margin: int

    @classmethod
    def of(cls, pieces: Sequence[Piece], dt: float) -> Holding:
        """What suits a whole log of these pieces, with ``dt`` in s; its blocks within blocks keep to it.

        From 12 runs on whole runs are dealt out; else 2 s of training rows are cut off either side of a held-out block,
        0.5 s where the log has less than 70 s of rows.
        """
        margin = MARGIN if rows_of(pieces) * dt >= SHORT else SHORT_MARGIN
        return cls(dealt=len({piece.run for piece in pieces}) >= DEALT, margin=round(margin / dt))


def folds(pieces: Pieces, count: int, holding: Holding) -> tuple[Fold, ...]:
    """One fold for each of ``count`` blocks of the ``pieces``: run i in block i mod ``count``, or equal rows in order.

    Raises ``InvalidValueError`` where there are fewer than two blocks, or fewer runs or rows than blocks.
    """
    if count < 2:
        raise InvalidValueError(f"{count} blocks leave nothing to compare: ask for two or more")
    if holding.dealt:
        return _dealt(pieces, count)
    if rows_of(pieces) < count:
        raise InvalidValueError(f"{rows_of(pieces)} rows do not make {count} blocks: record more, or ask for fewer")
    edges = [rows_of(pieces) * i // count for i in range(count + 1)]
    return tuple(_ordered(pieces, *pair, holding.margin) for pair in pairwise(edges))


def _dealt(pieces: Pieces, count: int) -> tuple[Fold, ...]:
    runs = list(dict.fromkeys(piece.run for piece in pieces))
    if len(runs) < count:
        raise InvalidValueError(f"{len(runs)} runs do not make {count} blocks: record more, or ask for fewer blocks")
    block = {run: i % count for i, run in enumerate(runs)}
    return tuple(
        Fold(
            training=tuple(piece for piece in pieces if block[piece.run] != i),
            held=tuple(piece for piece in pieces if block[piece.run] == i),
        )
        for i in range(count)
    )


def _ordered(pieces: Pieces, first: int, last: int, margin: int) -> Fold:
    """The fold whose block has the rows ``first`` to ``last`` of the pieces one after the other."""
    training: list[Piece] = []
    held: list[Piece] = []
    before = 0
    for piece in pieces:
        start = int(np.clip(first - before, 0, len(piece))) + piece.start
        stop = int(np.clip(last - before, 0, len(piece))) + piece.start
        before += len(piece)
        if start == stop:
            training.append(piece)
            continue
        held.append(Piece(start, stop, piece.run))
        sides = (Piece(piece.start, start - margin, piece.run), Piece(stop + margin, piece.stop, piece.run))
        training.extend(side for side in sides if side.stop > side.start)
    return Fold(tuple(training), tuple(held))
