"""What was looked at in a log, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from koopcli.records import Meta

Verdict = Literal["ok", "note", "warn", "ask"]


@dataclass(frozen=True)
class Check:
    """One look at a log: its ``name`` is a fixed word, beside it the ``signal`` that it is about, if it is about one.

    ``value`` in ``unit``, which is ``healthy`` within the range said in words; ``hint``: what mends it, empty where
    nothing has to be.
    """

    name: str
    value: float
    unit: str
    healthy: str
    verdict: Verdict
    hint: str = ""
    signal: str = ""

    @property
    def measured(self) -> str:
        """The value with its unit, if it has one."""
        return f"{self.value:.3g}" if self.unit == "1" else f"{self.value:.3g} {self.unit}"

    def pack(self) -> Meta:
        """The check as JSON."""
        return dict(vars(self))

    @classmethod
    def unpack(cls, meta: Meta) -> Check:
        """The inverse of :meth:`pack`."""
        return cls(**meta)
