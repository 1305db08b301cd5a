"""The error map as a view that can be turned and hovered, drawn by a library inside the page: the extra `report`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from koopcli.figures.balls import LARGEST_SHOWN
from koopcli.figures.colours import TRAINING
from koopcli.figures.drawing import Drawing
from koopcli.records import FloatArray

PATHS, EVERY = 90, 5  # training trajectories shown at most, and every so many of their samples
DIGITS = 3


def bundle() -> str | None:
    """The JavaScript library that turns the view, None where the extra is not installed."""
    try:
        from plotly.offline import get_plotlyjs  # noqa: PLC0415  (an extra, and slow to load)
    except ImportError:
        return None
    return str(get_plotlyjs())


def view(balls: Drawing, side: Drawing | None) -> str:
    """What the view shows, as JSON: the initial states of an error map, the training trajectories of an error side."""
    shown = {name: array.values[...] for name, array in balls.numbers.items()}
    units = {name: array.units for name, array in balls.numbers.items()}
    rmse, distance = shown["rmse"], shown["distance"]
    states = [name for name in shown if name.endswith("_0")][:3]
    names = [_written(name.removesuffix("_0")) for name in states]
    top = float(np.quantile(rmse, LARGEST_SHOWN)) or 1.0
    hover = [f"{name} %{{{axis}:.2f}} {units[state]}" for name, axis, state in zip(names, "xyz", states, strict=True)]
    points = {
        "type": "scatter3d",
        "mode": "markers",
        "name": "test states",
        **{axis: _list(shown[state]) for axis, state in zip("xyz", states, strict=True)},
        "customdata": np.round(np.stack([rmse, distance], axis=-1), DIGITS).tolist(),
        "hovertemplate": "<br>".join(
            ["RMSE %{customdata[0]:.1f} %", *hover, "%{customdata[1]:.3f} half-widths from the data<extra></extra>"]
        ),
        "marker": {
            "size": _list(3 + 7 * np.clip(rmse / top, 0, 1)),
            "color": _list(rmse),
            "colorscale": "Viridis",
            "reversescale": True,
            "cmin": 0,
            "cmax": round(top, DIGITS),
            "colorbar": {"title": {"text": "RMSE (%)", "side": "right"}, "thickness": 12, "len": 0.7},
            "line": {"width": 0},
        },
    }
    layout = {
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "legend": {"orientation": "h", "x": 0, "y": 0},
        "showlegend": side is not None,
        "uirevision": "kept",
        "scene": {
            "aspectmode": "cube",
            "camera": {"eye": {"x": 1.15, "y": -1.7, "z": 0.85}, "center": {"x": 0, "y": 0, "z": -0.1}},
            **{
                f"{axis}axis": {"title": {"text": f"{name} ({units[state]})"}}
                for axis, name, state in zip("xyz", names, states, strict=True)
            },
        },
    }
    data = [points] if side is None else [_paths(side, states), points]
    return json.dumps({"data": data, "layout": layout}, allow_nan=False).replace("</", "<\\/")


def _paths(side: Drawing, states: list[str]) -> dict[str, Any]:
    """Training trajectories as one broken line."""
    numbers = {name: array.values[...] for name, array in side.numbers.items()}
    which = numbers["training trajectory"]
    J = int(which.max()) + 1
    paths = np.stack([numbers[f"training {state.removesuffix('_0')}"].reshape(J, -1) for state in states], axis=-1)
    chosen = paths[:: -(-J // PATHS), ::EVERY]
    broken = np.concatenate([chosen, np.full((len(chosen), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    return {
        "type": "scatter3d",
        "mode": "lines",
        "name": "training trajectories (tap to hide)",
        **{axis: _list(values) for axis, values in zip("xyz", broken.T, strict=True)},
        "hoverinfo": "skip",
        "line": {"color": TRAINING, "width": 1},
        "opacity": 0.7,
    }


def _written(name: str) -> str:
    """A state as the library writes it: a symbol with its index, or plain words."""
    symbol, _, index = name.partition("_")
    return f"{symbol}<sub>{index}</sub>" if len(symbol) == 1 and index else name.replace("_", " ")


def _list(values: FloatArray) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), DIGITS) for value in values]
