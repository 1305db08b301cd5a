"""The selection of a predictor for a measured log: the choice on all of it, and the verdict of blocks held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from koopcli.koopman.selection import drive, sentences
from koopcli.koopman.selection.bicycle import roles_of
from koopcli.koopman.selection.blocks import Fold, Holding, Pieces, folds, pieces_of
from koopcli.koopman.selection.choice import DEFAULT, choose
from koopcli.koopman.selection.record import LEVELS, Selection
from koopcli.koopman.selection.regress import Rung
from koopcli.koopman.selection.verdict import Block, judge, refuse_short, refuse_still
from koopcli.koopman.selection.windows import Windows
from koopcli.records import Episodes, FloatArray


class Layout(NamedTuple):
    """A log as it is judged: x (rows, n_x) and u (rows, n_u), its pieces, the windows, and the blocks held out."""

    x: FloatArray
    u: FloatArray
    pieces: Pieces
    windows: Windows
    holding: Holding
    held_out: Sequence[Fold]


def laid_out(episodes: Episodes, rungs: Sequence[Rung], outer: int) -> Layout:
    """The layout of ``episodes`` for so many ``outer`` blocks.

    Raises ``InvalidValueError`` where a state never changes, and where the log is too short for its blocks.
    """
    x, u = np.asarray(episodes.x[...], dtype=float), np.asarray(episodes.u[...], dtype=float)
    refuse_still(x, episodes.state_channels.names)
    pieces = pieces_of(episodes)
    windows = Windows.of(episodes.dt, max(rung.memory for rung in rungs))
    holding = Holding.of(pieces, episodes.dt)
    held_out = folds(pieces, outer, holding)
    refuse_short(held_out, windows)
    return Layout(x, u, pieces, windows, holding, held_out)


def judged(episodes: Episodes, rungs: Sequence[Rung], outer: int, bicycle: bool, block: int) -> Block:
    """What comes of one ``block`` of so many ``outer`` ones, counted from 0; raises as :func:`laid_out`."""
    x, u, _, windows, holding, held_out = laid_out(episodes, rungs, outer)
    roles = roles_of(episodes.state_channels, episodes.input_channels) if bicycle else None
    return judge(x, u, held_out[block], rungs, windows, holding, roles)


def select(
    episodes: Episodes,
    rungs: Sequence[Rung] = DEFAULT,
    outer: int = 3,
    bicycle: bool = False,
    blocks: Sequence[Block] | None = None,
) -> Selection:
    """The rung that predicts ``episodes`` best, and the verdict of so many ``outer`` blocks.

    ``bicycle``: one identified from the same rows is compared as well, where the log has v_x, yaw_rate and steer;
    ``blocks``: what :func:`judged` gave of each, if that is known. Raises ``InvalidValueError`` as :func:`laid_out`.
    """
    x, u, pieces, windows, holding, held_out = laid_out(episodes, rungs, outer)
    every = blocks or [judged(episodes, rungs, outer, bicycle, i) for i in range(outer)]
    choice = choose(x, u, pieces, rungs, windows, holding)
    blind = choice.blind or any(block.choice.blind for block in every)
    models = tuple(every[0].errors)
    selection = Selection(
        rungs=tuple(rungs),
        chosen=0 if blind else choice.picked,
        scores=choice.scores,
        blind=blind,
        picked=np.array([block.choice.picked for block in every], dtype=np.int64),
        models=models,
        errors=np.array([[block.errors[model] for block in every] for model in models]),
        windows=np.array([len(block.missed) for block in every], dtype=np.int64),
        quantiles=np.quantile(np.concatenate([block.missed for block in every]), LEVELS, axis=0),
        spread=x.std(axis=0),
        gain=drive.explained(x, u, pieces, episodes.dt),
        gain_with_products=drive.explained(x, u, pieces, episodes.dt, products=True),
        use=drive.beyond(u, held_out),
        outside_share=float(np.concatenate([block.outside for block in every]).mean()),
        limited_share=float(np.concatenate([block.limited for block in every]).mean()),
        dt=episodes.dt,
        state_channels=episodes.state_channels,
        input_channels=episodes.input_channels,
    )
    return replace(selection, verdict=sentences.verdict(selection))
