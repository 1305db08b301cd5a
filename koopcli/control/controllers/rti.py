"""RTI: the slip plant linearised along the prediction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from koopcli.control.controllers.ltv import OnSlips


@dataclass(frozen=True, kw_only=True)
class RtiControl(OnSlips):
    """Predictive control on the slip plant, linearised along the last plan: one real-time iteration a step."""

    kind: ClassVar[str] = "rti"
    about: ClassVar[str] = "the equations with tyres, linearised along the plan"
    along: ClassVar[bool] = True
