"""The scores of many predictors on a grid of settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.records import Array, FloatArray, IndexArray, Meta, Packed

SCORES: dict[str, tuple[str, str]] = {
    "mean": ("rmse", "mean"),
    "std": ("rmse", "std"),
    "median": ("rmse", "median"),
    "max": ("rmse", "max"),
    "printed": ("rmse_printed", "mean"),
    "relift": ("rmse_relift", "mean"),
}  # by column: which statistic of which error, all in percent
COUNTS = ("functions", "trajectories", "diverged")
REPEATS = "seed"  # the last name of a setting that only draws again


@dataclass(frozen=True, eq=False, repr=False)
class Swept(Content):
    """Of each cell its place on each of the axes ``names``, as ``places`` (cells, axes) into their ``values``, -1 where
    a setting has no effect, and the ``scores`` (cells,) by column: errors in percent, and counts.
    """

    names: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]
    places: IndexArray
    scores: Mapping[str, FloatArray]

    def __len__(self) -> int:
        return len(self.places)

    def told(self, cell: int) -> dict[str, str]:
        """The settings of a cell, those that have an effect there."""
        row = self.places[cell].tolist()
        return {name: values[i] for name, values, i in zip(self.names, self.values, row, strict=True) if i >= 0}

    @property
    def best(self) -> int | None:
        """The cell of the smallest mean error, if any has one."""
        mean = self.scores["mean"]
        return int(np.nanargmin(mean)) if np.isfinite(mean).any() else None

    def groups(self) -> list[list[int]]:
        """The cells that differ in nothing but a seed, together."""
        kept = [i for i, name in enumerate(self.names) if name.rpartition(".")[2] != REPEATS]
        groups: dict[tuple[int, ...], list[int]] = {}
        for cell, place in enumerate(self.places[:, kept].tolist()):
            groups.setdefault(tuple(place), []).append(cell)
        return list(groups.values())

    def figures(self) -> Meta:
        """What scripts read."""
        best = self.best
        return {
            "cells": len(self),
            "axes": {name: list(values) for name, values in zip(self.names, self.values, strict=True)},
            "best": None
            if best is None
            else {
                "settings": self.told(best),
                **{name: float(self.scores[name][best]) for name in ("mean", "std", "median", "max")},
            },
        }

    def table(self) -> tuple[list[str], list[list[Any]]]:
        """A row for each cell: its settings, empty where they have no effect, and its scores."""
        header = [*self.names, *(f"{name} (%)" if name in SCORES else name for name in self.scores)]
        rows = []
        for cell in range(len(self)):
            told = self.told(cell)
            scores = [column[cell] for column in self.scores.values()]
            rows.append([*(told.get(name, "") for name in self.names), *map(_number, scores)])
        return header, rows

    def pack(self) -> Packed:
        """The scores for storage."""
        arrays = {"places": Array(self.places, ("cell", "axis"), "1")}
        arrays |= {
            f"scores/{name}": Array(column, ("cell",), "%" if name in SCORES else "1")
            for name, column in self.scores.items()
        }
        axes = [{"name": name, "values": list(v)} for name, v in zip(self.names, self.values, strict=True)]
        return Packed(arrays, {"axes": axes, "columns": list(self.scores)})

    @classmethod
    def unpack(cls, packed: Packed) -> Swept:
        """The inverse of :meth:`pack`."""
        axes = packed.meta["axes"]
        return cls(
            tuple(axis["name"] for axis in axes),
            tuple(tuple(axis["values"]) for axis in axes),
            packed.arrays["places"].values[...],
            {name: packed.arrays[f"scores/{name}"].values[...] for name in packed.meta["columns"]},
        )


def swept(
    names: Sequence[str], values: Sequence[Sequence[str]], places: Sequence[Sequence[int]], figures: Sequence[Meta]
) -> Swept:
    """The scores of cells from the ``figures`` of their evaluations."""
    columns: dict[str, FloatArray] = {
        column: np.array([numbers[error][statistic] for numbers in figures], dtype=float)
        for column, (error, statistic) in SCORES.items()
    }
    columns |= {name: np.array([numbers[name] for numbers in figures], dtype=float) for name in COUNTS}
    where = np.array(places, dtype=np.int64).reshape(len(places), len(names))
    return Swept(tuple(names), tuple(map(tuple, values)), where, columns)


def _number(value: float) -> Any:
    if not math.isfinite(value):
        return ""
    return int(value) if value == int(value) and abs(value) < 2**53 else float(value)
