"""Which trajectories fits and scores work with."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

from koopcli.records import Trajectories
from koopcli.stages.base import Context

T = TypeVar("T")
ROLE = "trajectories"


def finished(trajectories: Trajectories, context: Context) -> Trajectories:
    """Those that ran their whole length; says how many did not."""
    whole = trajectories.finished()
    if len(whole) < len(trajectories):
        left = len(trajectories) - len(whole)
        context.warn(f"{left} of {len(trajectories)} trajectories ended early and are left out")
    return whole


def as_inputs(trajectories: Sequence[T]) -> tuple[tuple[str, T], ...]:
    """One or several trajectories as inputs by role: "trajectories", "2/trajectories", …"""
    return tuple((ROLE if i == 1 else f"{i}/{ROLE}", item) for i, item in enumerate(trajectories, 1))


def roles_of(inputs: Iterable[str]) -> list[str]:
    """The roles of trajectories among ``inputs``, in their order."""
    roles = [role for role in inputs if role.rpartition("/")[2] == ROLE]
    return sorted(roles, key=lambda role: int(role.partition("/")[0]) if role != ROLE else 1)
