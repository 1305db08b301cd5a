"""What better settings were measured to buy, for the advice after a verdict. A slow test of `koop evaluate` measures
every number again at full size, by the commands that stand beside it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Gain:
    """The mean RMSE on a shipped vehicle, in percent, ``before`` and ``after``, each with the command that gives it."""

    vehicle: str
    before: float
    after: float
    command_before: str
    command_after: str


INPUTS = Gain("ctu-2020", 3.323, 0.05724, "koop evaluate", "koop evaluate --experiment best-edmd")
COASTING = Gain(
    "ctu-2020",
    0.1161,
    0.00467,
    "koop evaluate --excitation none",
    "koop evaluate --excitation none --set sample.draw=even --set fit-edmd.order=10",
)
TYRES = Gain(
    "rimac-2018",
    66.29,
    0.06929,
    "koop evaluate --set experiment.fit=fit-eigen --vehicle rimac-2018",
    "koop evaluate --experiment best-eigen --vehicle rimac-2018",
)
WHEELS = Gain(
    "ctu-2020",
    0.815,
    0.0785,
    "koop evaluate --set simulate.plant=wheels --set fit-edmd.basis=total --set fit-edmd.order=2",
    "koop evaluate --set simulate.plant=wheels --set fit-edmd.basis=total --set fit-edmd.order=2 "
    "--set fit-edmd.terms=bilinear",
)
GAINS = {"inputs": INPUTS, "coasting": COASTING, "tyres": TYRES, "wheels": WHEELS}
