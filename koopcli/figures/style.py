"""The one style of all figures, and how they are rendered: one printed column, colour-blind safe."""

from __future__ import annotations

import io
from contextlib import AbstractContextManager

import matplotlib as mpl
from matplotlib.figure import Figure

COLUMN = 3.5  # inches, one column of a two-column page

# Okabe and Ito's palette: distinct to every common form of colour vision
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
PAPER = "#000000"
TRAINING = "#bbbbbb"
SHADES = "viridis_r"  # even in lightness, dark where errors are large

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
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "legend.frameon": False,
    "savefig.dpi": 300,
    "svg.hashsalt": "koop",
    "svg.fonttype": "none",
}


def axis_label(name: str, unit: str) -> str:
    """A state with its unit: a symbol with its index, or plain words."""
    symbol, _, index = name.partition("_")
    return f"${symbol}_{{{index}}}$ ({unit})" if len(symbol) == 1 and index else f"{name.replace('_', ' ')} ({unit})"


def style() -> AbstractContextManager[None]:
    """The style for the time of a ``with``; no global state stays changed."""
    return mpl.rc_context(STYLE)  # type: ignore[arg-type]


UNDATED: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None, "ModDate": None},
}


def render(figure: Figure, image: str) -> bytes:
    """The figure as a png, svg or pdf file; the same figure gives the same bytes."""
    target = io.BytesIO()
    with style():
        figure.savefig(target, format=image, metadata=UNDATED[image])
    return target.getvalue()
