"""Which trajectories fits and scores work with."""

from __future__ import annotations

from koopcli.records import Trajectories
from koopcli.stages.base import Context


def finished(trajectories: Trajectories, context: Context) -> Trajectories:
    """Those that ran their whole length; says how many did not."""
    found = trajectories.finished()
    if len(found) < len(trajectories):
        left = len(trajectories) - len(found)
        context.warn(f"{left} of {len(trajectories)} trajectories ended early and are left out")
    return found
