"""The nearest node alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from koopcli.koopman.eigen.lookup.cloud import Cloud
from koopcli.koopman.eigen.lookup.lookup import Lift
from koopcli.records import FloatArray, IndexArray


class Nearest:
    """The node nearest to a place, (7.6)."""

    def __init__(self, nodes: Cloud) -> None:
        self._nodes = nodes

    def __call__(self, y: FloatArray) -> tuple[IndexArray, FloatArray]:
        """Index (n, 1) and weight one for each of ``y`` (n, n_x)."""
        return self._nodes.near(y), np.ones((len(y), 1))


@dataclass(frozen=True)
class NearestLift(Lift):
    """The nearest sample."""

    kind: ClassVar[str] = "nearest"
    beyond = "take the nearest sample, as everywhere"

    def make(self, nodes: Cloud) -> Nearest:
        """The lookup among ``nodes``."""
        return Nearest(nodes)

    def fewest(self, states: int) -> int:
        """One will do."""
        return 1
