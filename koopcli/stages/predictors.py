"""What every stage that fits a predictor tells of it."""

from __future__ import annotations

from koopcli.koopman.predictor.predictor import Predictor
from koopcli.records import Meta


def figures(predictor: Predictor) -> Meta:
    """The numbers of a fit that scripts read (`--json`)."""
    regression = predictor.regression
    return {
        "functions": predictor.functions,
        "rank": regression.rank,
        "directions": regression.directions,
        "condition": regression.condition,
        "spectral_radius": predictor.spectral_radius,
        "horizon": predictor.horizon,
        "solved_by": regression.solved_by,
    }


def size(figures: Meta) -> str:
    """How large the predictor is, and whether it grows, in a few words."""
    return f"{figures['functions']} functions, spectral radius {figures['spectral_radius']:.6g}"


def regression(figures: Meta) -> str:
    """How well the data determine it."""
    return f"rank {figures['rank']} of {figures['directions']}"
