"""What is known of the regression behind a predictor."""

from __future__ import annotations

import math
from dataclasses import dataclass

from koopcli.records import Meta


@dataclass(frozen=True)
class Regression:
    """How many of its ``directions`` the data determine (``rank``), its ``condition`` number, how it was ``solved_by``
    (as :mod:`koopcli.koopman.edmd.blockwise` and ``product`` name it), the share of the data in percent that the
    exponentials do not represent, ``missed``, where there are any, and the estimated standard deviation of the
    ``noise`` of each state (n_x,) that was smoothed away, where any was. ``notes``: what of the fit was not as asked
    for, or what the data do not tell, a line each.
    """

    rank: int
    directions: int
    condition: float
    solved_by: str = ""
    missed: float | None = None
    noise: tuple[float, ...] | None = None
    notes: tuple[str, ...] = ()

    def pack(self) -> Meta:
        """The facts for storage; an infinite condition is none, and what there is none of, noise or notes, left out."""
        facts: Meta = {**vars(self), "condition": self.condition if math.isfinite(self.condition) else None}
        noise, notes = facts.pop("noise"), facts.pop("notes")
        if noise is not None:
            facts["noise"] = list(noise)
        return {**facts, "notes": list(notes)} if notes else facts

    @classmethod
    def unpack(cls, meta: Meta) -> Regression:
        """The inverse of :meth:`pack`."""
        condition = math.inf if meta["condition"] is None else meta["condition"]
        noise = tuple(meta["noise"]) if "noise" in meta else None
        notes = tuple(meta.get("notes", ()))
        return cls(**{**meta, "condition": condition, "noise": noise, "notes": notes})
