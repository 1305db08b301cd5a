"""What every stage that fits a predictor tells of it."""

from __future__ import annotations

from koopcli.koopman.predictor import Predictor
from koopcli.records import Meta


def figures(predictor: Predictor) -> Meta:
    """The figures of a fit that scripts read (`--json`)."""
    return {
        "functions": predictor.functions,
        "rank": predictor.rank,
        "directions": predictor.directions,
        "condition": predictor.condition,
        "spectral_radius": predictor.spectral_radius,
        "horizon": predictor.horizon,
        "solved_by": predictor.solved_by,
    }


def describe(figures: Meta) -> str:
    """The same in a few words."""
    way = f", by {figures['solved_by']}" if figures["solved_by"] else ""
    return (
        f"{figures['functions']} functions, rank {figures['rank']} of {figures['directions']}, "
        f"condition {figures['condition']:.2g}, spectral radius {figures['spectral_radius']:.6g}{way}"
    )
