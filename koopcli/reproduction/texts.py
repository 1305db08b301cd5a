"""Numbers as the tables of a report write them."""

from __future__ import annotations

import math

from koopcli.records import Meta

SMALLEST, LARGEST = 5, 6  # powers of ten between which numbers are written without one


def number_text(value: float, digits: int = 3) -> str:
    """A number with ``digits`` significant ones, written as people write it: 3.30, 1230, 1.0e-12."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
    if not -SMALLEST <= exponent < LARGEST:
        return f"{value:.{digits - 1}e}"
    decimals = digits - 1 - exponent
    return f"{round(value, decimals):.{max(0, decimals)}f}"


def statistic_text(figures: Meta, name: str) -> str:
    """A statistic of the RMSE: the deviation with two significant digits, any other with three."""
    return number_text(figures["rmse"][name], 2 if name == "std" else 3)


def mean_text(figures: Meta | None) -> str:
    """``mean ± std`` of the RMSE, or that it diverges."""
    if figures is None:
        return "–"
    if not math.isfinite(figures["rmse"]["mean"]):
        return "diverges"
    return f"{statistic_text(figures, 'mean')} ± {statistic_text(figures, 'std')}"


def score_text(figures: Meta | None) -> str:
    """``mean ± std (median)`` of the RMSE, or that it diverges."""
    text = mean_text(figures)
    return text if figures is None or "±" not in text else f"{text} ({statistic_text(figures, 'median')})"


def count_text(*numbers: int) -> str:
    """Counts with thousands apart, joined by a times sign."""
    return " × ".join(f"{number:,}".replace(",", " ") for number in numbers)
