"""The verdict on a measured log in plain sentences (10.10)."""

from __future__ import annotations

import math

import numpy as np

from koopcli.koopman.selection.record import BICYCLE, CHOSEN, DMDC_ROW, HOLD, MEAN, Selection
from koopcli.koopman.selection.windows import HORIZONS

SHOWN = 1  # the place of the horizon that the sentences name
NEAR_HOLD = 0.98  # of the error of holding: ratios that are closer are noise
NEAR_MEAN = 0.95  # of the error of the mean: what is not below knows nothing but the mean
DRIVEN = 0.1  # gain in R²: below it the mean inputs explain next to nothing
DRIVEN_BY_PRODUCTS = 0.3  # the same with their products, of which some always fit a little
USED = 2.0  # times its training range: an input that moves so far in a block is hardly used outside it
OUTSIDE = 0.05  # of the held-out rows
LIMITED = 0.05


def is_predicted(selection: Selection) -> list[bool]:
    """Of each state whether its forecast is worth more than holding it, and than its mean in the training rows.

    Against holding the geometric mean over the horizons counts; of noise the mean is the best forecast there is, so a
    state has to be below that at one horizon at least.
    """
    to_mean = selection.ratios(CHOSEN, MEAN).min(axis=0).tolist()
    pairs = zip(_by_state(selection, HOLD), to_mean, strict=True)
    return [hold < NEAR_HOLD and mean < NEAR_MEAN for hold, mean in pairs]


def verdict(selection: Selection) -> str:
    """The verdict as one line; the word "no" stands in it where a state is not predicted."""
    predicted = is_predicted(selection)
    some = "No" if 2 * sum(predicted) < len(predicted) else "In part"
    word = "Yes" if all(predicted) else some
    states = "; ".join(_state(selection, i, known) for i, known in enumerate(predicted))
    return " ".join([f"{word}: {states}.", _against(selection), *_reserves(selection), *_advice(selection, predicted)])


def _by_state(selection: Selection, reference: str) -> list[float]:
    return list(np.exp(np.log(selection.ratios(CHOSEN, reference)).mean(axis=0)).tolist())


def _state(selection: Selection, i: int, known: bool) -> str:
    name, unit = selection.state_channels.names[i], selection.state_channels.units[i]
    to_hold = _by_state(selection, HOLD)[i]
    if not known:
        why = "no better than holding it" if to_hold >= NEAR_HOLD else "no better than its mean"
        return f"{name} not predicted, {why}" + (f": {_undriven(selection, name)}" if _idle(selection, i) else "")
    step = selection.judged[SHOWN]
    error = selection.pooled(CHOSEN)[step, i]
    low, high = (bound[step, i] for bound in selection.span(CHOSEN))
    text = f"{name} within {_short(error)} {unit} at {HORIZONS[SHOWN]:g} s ({_short(low)} to {_short(high)} over "
    text += f"{len(selection.windows)} blocks), {_short(1 / to_hold)} times better than holding"
    share = f", though the mean inputs explain {100 * selection.gain[i]:.0f} % of its change"
    return text + (share if selection.gain[i] < DRIVEN and len(selection.input_channels) else "")


def _steered(selection: Selection, name: str) -> bool:
    """Whether a state is one that steer moves, however little of it the means of inputs explain."""
    return name in ("v_y", "yaw_rate") and "steer" in selection.input_channels.names


def _undriven(selection: Selection, name: str) -> str:
    steered = _steered(selection, name)
    return "the mean inputs explain little of its change" if steered else "nothing among the inputs drives it"


def _idle(selection: Selection, i: int) -> bool:
    """Whether nothing among the inputs drives a state."""
    return bool(selection.gain[i] < DRIVEN and selection.gain_with_products[i] < DRIVEN_BY_PRODUCTS)


def _against(selection: Selection) -> str:
    ratio, blocks = selection.ratio(CHOSEN, DMDC_ROW), selection.block_ratios(CHOSEN, DMDC_ROW)
    better = "DMDc, without memory and products, is better here: errors" if ratio > 1 else "Errors"
    text = f"{better} are {ratio:.2f} times those of DMDc ({blocks.min():.2f} to {blocks.max():.2f} block by block)"
    if BICYCLE in selection.models:
        text += f" and {selection.ratio(CHOSEN, BICYCLE):.2f} times those of a bicycle identified from the same rows"
    return f"{text}."


def _reserves(selection: Selection) -> list[str]:
    """What limits the verdict."""
    said = []
    if selection.blind:
        said.append(f"The log is too short to compare rungs: {selection.chosen_rung} is the first of them.")
    if selection.outside_share > OUTSIDE:
        said.append(f"{100 * selection.outside_share:.0f} % of the held-out rows lie outside the training states.")
    if selection.limited_share > LIMITED:
        share = f"{100 * selection.limited_share:.0f} % of the held-out rows"
        said.append(f"In {share} an input is limited to its training range.")
    return said


def _advice(selection: Selection, predicted: list[bool]) -> list[str]:
    """What to record next."""
    said = []
    for name, use in zip(selection.input_channels.names, selection.use.tolist(), strict=True):
        if math.isnan(use):
            said.append(f"{name} never moves: record drives in which it does.")
        elif use > USED:
            far = f"in one block it moves {_short(use)} times as far as in all others"
            far = "it moves in one block alone" if math.isinf(use) else far
            said.append(f"{name} is hardly used: {far}; record more.")
    names = enumerate(selection.state_channels.names)
    idle = [name for i, name in names if not predicted[i] and _idle(selection, i) and not _steered(selection, name)]
    if idle:
        listed, them = " and ".join(idle), "it an input" if len(idle) == 1 else "them inputs"
        said.append(f"Record what drives {listed}, or make {them}.")
    return said


def _short(value: float) -> str:
    """Two digits of a number."""
    return f"{float(f'{value:.2g}'):g}"
