"""The selection of a predictor for a measured log: the choice on all of it, and the verdict of blocks held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from koopcli.koopman.selection import drive, sentences
from koopcli.koopman.selection.bicycle import roles_of
from koopcli.koopman.selection.blocks import Holding, folds, pieces_of
from koopcli.koopman.selection.choice import DEFAULT, choose
from koopcli.koopman.selection.record import LEVELS, Selection
from koopcli.koopman.selection.regress import Rung
from koopcli.koopman.selection.verdict import judge, refuse_short, refuse_still
from koopcli.koopman.selection.windows import Windows
from koopcli.progress import Progress, silent
from koopcli.records import Episodes


def select(
    episodes: Episodes,
    rungs: Sequence[Rung] = DEFAULT,
    outer: int = 3,
    bicycle: bool = False,
    progress: Progress = silent,
) -> Selection:
    """The rung that predicts ``episodes`` best, and the verdict of so many ``outer`` blocks.

    ``bicycle``: one identified from the same rows is compared as well, where the log has v_x, yaw_rate and steer.
    Raises ``InvalidValueError`` where a state never changes, and where the log is too short for its blocks.
    """
    x, u = np.asarray(episodes.x[...], dtype=float), np.asarray(episodes.u[...], dtype=float)
    refuse_still(x, episodes.state_channels.names)
    pieces = pieces_of(episodes)
    windows = Windows.of(episodes.dt, max(rung.memory for rung in rungs))
    holding = Holding.of(pieces, episodes.dt)
    held_out = folds(pieces, outer, holding)
    refuse_short(held_out, windows)
    roles = roles_of(episodes.state_channels, episodes.input_channels) if bicycle else None
    judged = []
    for i, fold in enumerate(held_out):
        progress(i, outer + 1)
        judged.append(judge(x, u, fold, rungs, windows, holding, roles))
    progress(outer, outer + 1)
    choice = choose(x, u, pieces, rungs, windows, holding)
    progress(outer + 1, outer + 1)
    blind = choice.blind or any(block.choice.blind for block in judged)
    models = tuple(judged[0].errors)
    selection = Selection(
        rungs=tuple(rungs),
        chosen=0 if blind else choice.picked,
        scores=choice.scores,
        blind=blind,
        picked=np.array([block.choice.picked for block in judged], dtype=np.int64),
        models=models,
        errors=np.array([[block.errors[model] for block in judged] for model in models]),
        windows=np.array([len(block.missed) for block in judged], dtype=np.int64),
        quantiles=np.quantile(np.concatenate([block.missed for block in judged]), LEVELS, axis=0),
        spread=x.std(axis=0),
        gain=drive.explained(x, u, pieces, episodes.dt),
        gain_with_products=drive.explained(x, u, pieces, episodes.dt, products=True),
        use=drive.beyond(u, held_out),
        outside_share=float(np.concatenate([block.outside for block in judged]).mean()),
        limited_share=float(np.concatenate([block.limited for block in judged]).mean()),
        dt=episodes.dt,
        state_channels=episodes.state_channels,
        input_channels=episodes.input_channels,
    )
    return replace(selection, verdict=sentences.verdict(selection))
