"""Where the errors are: mean RMSE over a slice of initial states, beside the paper's balls in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.balls import Balls, balls, columns
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import COLUMN, SHADES, Figure, axis_label, in_space, style, symbol, ticks
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(
    about="RMSE by initial state: its mean over a slice, and every state in space",
    takes="evaluation",
    usual="fit-eigen",
)

PALEST = 0.2  # opacity of a ball without error
ACROSS, UP, THROUGH = 0, 2, 1  # the states of the slice, and the one that it is thin in
THICKNESS = 1 / 3  # of the range of that state
EACH = 7  # states of a bin, about
MOST = 20  # bins along an axis
FEWEST = 3  # states that have a mean worth drawing


@dataclass(frozen=True)
class ErrorMap:
    """All initial states as ``balls``; of those with the state ``THROUGH`` between ``ends`` (2,) the ``mean`` RMSE in
    percent and how many ``states`` there are, (bins up, bins across) between ``edges``; a bin of few has no mean.
    """

    balls: Balls
    ends: FloatArray
    edges: tuple[FloatArray, FloatArray]
    mean: FloatArray
    states: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> ErrorMap:
    """What the figure shows. Raises ``InvalidValueError`` where every prediction diverged."""
    seen = balls(sources[0])
    low, high = seen.x0.min(axis=0), seen.x0.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    ends = middle[THROUGH] + THICKNESS * half[THROUGH] * np.array([-1, 1])
    inside = (seen.x0[:, THROUGH] >= ends[0]) & (seen.x0[:, THROUGH] <= ends[1])
    if not inside.any():
        inside = np.ones(len(inside), dtype=bool)
        ends = np.array([low[THROUGH], high[THROUGH]])
    bins = int(np.clip(np.sqrt(inside.sum() / EACH), 1, MOST))
    across, up = (np.linspace(middle[i] - half[i], middle[i] + half[i], bins + 1) for i in (ACROSS, UP))
    y, x = seen.x0[inside, UP], seen.x0[inside, ACROSS]
    states = np.histogram2d(y, x, bins=[up, across])[0]
    total = np.histogram2d(y, x, bins=[up, across], weights=seen.rmse[inside])[0]
    enough = states >= min(FEWEST, states.max())
    mean = np.divide(total, states, out=np.full(states.shape, np.nan), where=enough)
    return ErrorMap(seen, ends, (across, up), mean, states)


def numbers(shown: ErrorMap) -> Mapping[str, Array]:
    """Every initial state with its error; the slice, its bins that have a mean, and how many states they are of."""
    rows, cells = np.nonzero(np.isfinite(shown.mean))
    (across, up), channels = shown.edges, shown.balls.channels
    through = channels.names[THROUGH], channels.units[THROUGH]
    bins = {
        f"bin/{channels.names[state]} {end}": column(edges[which + step], "bin", channels.units[state])
        for state, edges, which in ((ACROSS, across, cells), (UP, up, rows))
        for end, step in (("from", 0), ("to", 1))
    }
    return {
        **columns(shown.balls),
        **{f"slice/{through[0]} {end}": column(shown.ends[i : i + 1], "slice", through[1]) for i, end in FROM_TO},
        **bins,
        "bin/mean rmse": column(shown.mean[rows, cells], "bin", "%"),
        "bin/states": column(shown.states[rows, cells], "bin", "1"),
    }


CUT, SPACE, BAR = (
    (0.145, 0.17, 0.485, 0.74),
    (0.65, 0.36, 0.285, 0.45),
    (0.68, 0.17, 0.27, 0.03),
)  # shares of the figure
FROM_TO = ((0, "from"), (1, "to"))


def draw(shown: ErrorMap) -> Figure:
    """The slice large; beside it all states in space, the paler the smaller the error, in the same colours."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d import Axes3D

    seen = shown.balls
    names = [axis_label(n, u) for n, u in zip(seen.channels.names, seen.channels.units, strict=True)]
    scale = Normalize(0, seen.top)
    shades = ScalarMappable(scale, SHADES)
    through = shades.to_rgba(seen.rmse)
    through[:, 3] = PALEST + (1 - PALEST) * np.clip(seen.rmse / seen.top, 0, 1)
    with style():
        figure = Figure(figsize=(COLUMN, 2.45))
        cut = figure.add_axes(CUT)
        cut.grid(visible=False)
        cut.pcolormesh(*shown.edges, shown.mean, cmap=SHADES, norm=scale, edgecolors="face", linewidth=0.1)
        cut.set_xlabel(names[ACROSS])
        cut.set_ylabel(names[UP])
        cut.set_title(f"mean where {_within(shown)}", fontsize=8)
        space = Axes3D(figure, SPACE)
        figure.add_axes(space)
        space.scatter(
            *seen.x0[:, :3].T, s=seen.sizes / 3, color=through, depthshade=False, linewidths=0, rasterized=True
        )
        in_space(space, [symbol(name) for name in seen.channels.names], zoom=1.08)
        space.set_title("every state", fontsize=8)
        for axis in (space.xaxis, space.yaxis, space.zaxis):
            ticks(axis, 2)
            axis.set_ticklabels([])
            axis.labelpad = -17
            axis.set_rotate_label(axis is space.zaxis)
        bar = figure.add_axes(BAR)
        figure.colorbar(shades, cax=bar, orientation="horizontal", label="RMSE (%)", extend=seen.beyond)
    return figure


def _within(shown: ErrorMap) -> str:
    """The slice in words."""
    name, unit = shown.balls.channels.names[THROUGH], shown.balls.channels.units[THROUGH]
    low, high = shown.ends
    if abs(low + high) < 0.05 * (high - low):
        return f"|{symbol(name)}| < {(high - low) / 2:.3g} {unit}"
    return f"{low:.3g} < {symbol(name)} < {high:.3g} {unit}".replace("-", "−")
