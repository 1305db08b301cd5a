"""The one style of all figures, and how they are rendered: one printed column, colour-blind safe."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from importlib import import_module
from textwrap import fill, wrap
from typing import TYPE_CHECKING, Any

from koopcli.figures.kit.signature import LONGEST
from koopcli.text import printable

if TYPE_CHECKING:
    from matplotlib import axes, figure
    from matplotlib.axis import Axis
    from mpl_toolkits.mplot3d import Axes3D

    Axes = axes.Axes
    Figure = figure.Figure
else:  # a figure is declared without matplotlib, which is imported when the first one is drawn

    def Figure(**look: Any) -> Any:  # noqa: D103
        return import_module("matplotlib.figure").Figure(**look)

    Axes = Any

# Okabe and Ito's palette: distinct to every common form of colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
DASHES = ("-", "--", ":")
PAPER = "#000000"
TRAINING = "#bbbbbb"
GUIDE = "#888888"  # what is not data: axes through zero, the unit circle, restarts
OTHERS = ("#555555", "#999999")  # lines that another one is set beside
BAND = "#b9d7ea"  # what most of the data lie in
SHADES = "viridis_r"  # even in lightness, dark where errors are large

COLUMN = 3.5  # inches, one column of a two-column page
DOTS = 300  # per inch, of a png
SMALLEST = 7  # points: what can be read in print
GAP = 0.04  # inches: above the line that says what a figure is of

WIDEST, HANDLE, LINE = 62, 10, 0.13  # letters of a legend in one column, of a line before its name; inches of a row
NARROW = 2000  # ratio of the ends of a logarithmic axis below which 2 and 5 are written too

STYLE = {
    "font.size": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "legend.title_fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "legend.frameon": False,
    "savefig.dpi": DOTS,
    "svg.hashsalt": "koop",
    "svg.fonttype": "none",
}


def looks(count: int) -> list[dict[str, Any]]:
    """Colour and dashes of each of ``count`` lines, all different up to three times the colours.

    Dashes change from line to line, so that one that lies over another lets it through.
    """
    return [
        {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[(i + i // len(COLOURS)) % len(DASHES)]}
        for i in range(count)
    ]


def plain(text: str) -> str:
    """A user's text as it stands: neither mathematics nor, with a line in front, something to leave out of legends;
    no control character, which an svg file may not hold.
    """
    shown = printable(text).replace("$", r"\$")
    return f"\u200b{shown}" if shown.startswith("_") else shown


def legend_below(figure: Figure, title: str | None = None, columns: int = 2, **look: float) -> None:
    """The legend under the panels, in as many ``columns`` as its words leave room for, and room for its rows."""
    legends = [axes.get_legend_handles_labels() for axes in figure.axes]
    handles = [handle for some, _ in legends for handle in some]
    labels = [fill(label, WIDEST) for _, names in legends for label in names]
    longest = max(len(line) for label in labels for line in label.splitlines())
    if columns * (longest + HANDLE) > WIDEST + HANDLE:
        columns = 1
    rows = sum(label.count("\n") + 1 for label in labels) / columns
    figure.set_figheight(figure.get_figheight() + LINE * max(0.0, rows - 2))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, title=title, **look)


def ticks(axis: Axis, *most: int, **look: Any) -> None:
    """At most so many intervals between round numbers along an axis; ``look``: as ``MaxNLocator`` takes it."""
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(*most, **look))


def plain_numbers(axis: Axis) -> None:
    """Numbers on a logarithmic axis as people write them, 0.1 and 20 rather than powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high < NARROW * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def in_space(axes: Axes3D, names: Sequence[str], zoom: float) -> None:
    """Labels, the point of view and the box of axes in space, so that nothing is cut off at one column."""
    axes.view_init(elev=24, azim=-58)
    axes.set_box_aspect((1, 1, 0.85), zoom=zoom)
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), names, strict=False):
        axis.set_label_text(name)
        axis.labelpad = -6 if axis is axes.zaxis else -7
        axis.set_tick_params(pad=-2)
        axis.pane.set_facecolor("white")
        ticks(axis, 4)


def symbol(name: str) -> str:
    """A state as it is written: a letter with its index, or plain words."""
    letter, _, index = name.partition("_")
    return f"${letter}_{{{index}}}$" if len(letter) == 1 and index else name.replace("_", " ")


def axis_label(name: str, unit: str) -> str:
    """A state with its unit."""
    return f"{symbol(name)} ({unit})"


def style() -> AbstractContextManager[None]:
    """The style for the time of a ``with``, over matplotlib's own defaults: a user's matplotlibrc changes nothing."""
    from matplotlib import style as of_matplotlib

    return of_matplotlib.context(["default", STYLE])


UNDATED: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None, "ModDate": None},
}


def render(figure: Figure, image: str, line: str) -> bytes:
    """The figure as a png, svg or pdf file, with a grey ``line`` in a strip of its own below all that is drawn; the
    same figure gives the same bytes.
    """
    from matplotlib.transforms import Bbox

    target = io.BytesIO()
    lines = wrap(line, LONGEST)
    width, height = figure.get_size_inches()
    with style():
        _fix(figure)
        for i, text in enumerate(lines):
            y = -(GAP + LINE * (i + 0.5)) / height
            figure.text(0.99, y, text, ha="right", va="center", fontsize=SMALLEST, color=GUIDE)
        whole = Bbox([[0, -GAP - LINE * len(lines) - GAP / 2], [width, height]])
        figure.savefig(target, format=image, metadata=UNDATED[image], bbox_inches=whole)
    return target.getvalue()


def _fix(figure: Figure) -> None:
    """Lay the figure out for print, for good: what is saved of it is then more than itself."""
    figure.set_dpi(DOTS)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    for legend in figure.legends:
        legend.set_bbox_to_anchor((0, 0, 1, 1), transform=figure.transFigure)
