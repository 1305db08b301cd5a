"""A log that was imported: episodes on one grid, with what was checked and noted on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from koopcli.content import Content
from koopcli.logs.check import Check
from koopcli.records import Array, BoolArray, Episodes, Meta, Packed


@dataclass(frozen=True, eq=False, repr=False)
class Log(Content):
    """What a log holds once it is imported.

    ``episodes`` in SI; ``checks`` of its times and of its numbers; ``notes``: one line each, on what was left out or
    assumed; ``wheelbase`` in m, for the checks; ``display``: the unit of the map for each state and input, by name;
    ``flagged`` (rows,): rows that were interpolated over several missing samples of some channel, None if not known.
    """

    episodes: Episodes
    checks: tuple[Check, ...] = ()
    notes: tuple[str, ...] = ()
    wheelbase: float | None = None
    display: Mapping[str, str] = field(default_factory=dict)
    flagged: BoolArray | None = None

    def __repr__(self) -> str:
        asked = sum(check.verdict == "ask" for check in self.checks)
        told = f"{len(self.checks)} checks, {asked} that ask, {len(self.notes)} notes"
        return f"Log: {told}; {self.episodes!r}"

    def pack(self) -> Packed:
        """The log for storage."""
        packed = self.episodes.pack()
        arrays = dict(packed.arrays)
        if self.flagged is not None:
            arrays["flagged"] = Array(self.flagged.astype(np.int8), ("row",), "1")
        meta = {
            **packed.meta,
            "checks": [check.pack() for check in self.checks],
            "notes": list(self.notes),
            "wheelbase": self.wheelbase,
            "display": dict(self.display),
        }
        return Packed(arrays, meta)

    @classmethod
    def unpack(cls, packed: Packed) -> Log:
        """The inverse of :meth:`pack`; states and inputs stay where they are."""
        flagged = packed.arrays.get("flagged")
        return cls(
            episodes=Episodes.unpack(packed),
            checks=tuple(Check.unpack(check) for check in packed.meta["checks"]),
            notes=tuple(packed.meta["notes"]),
            wheelbase=packed.meta["wheelbase"],
            display=packed.meta["display"],
            flagged=None if flagged is None else np.asarray(flagged.values[...]).astype(bool),
        )

    def figures(self) -> Meta:
        """What is told of the log as plain values; ``seconds_logged``: from first to last row, over all episodes."""
        steps = self.episodes.rows - len(self.episodes)
        return {
            "rows": self.episodes.rows,
            "episodes": len(self.episodes),
            "seconds_logged": steps * self.episodes.dt,
            "states": list(self.episodes.state_channels.names),
            "inputs": list(self.episodes.input_channels.names),
            "checks": [check.pack() for check in self.checks],
        }
