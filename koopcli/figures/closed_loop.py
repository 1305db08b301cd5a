"""A closed loop: the path from above with the car along it, states beside their reference, and inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.control.closed import BODY, INPUTS, ClosedLoop
from koopcli.figures.kit.figure import FigureKind, Source, column, state_columns
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, OTHERS, Figure, axis_label, style, ticks
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(about="a closed loop: path, states beside their reference, inputs", takes="loop")

CARS = 12  # drawn along the path
LENGTH, WIDTH = 4.5, 1.8  # m, of a car that is drawn
PATH, PANEL, BESIDES = 1.3, 0.8, 0.7  # inches


@dataclass(frozen=True)
class Shown:
    """One car: ``time`` (k + 1,) in s, ``states`` and ``reference`` (k + 1, 3), ``inputs`` (k, 4), and ``ground``
    (k + 1, 3): where it is in m, and its heading in rad.
    """

    time: FloatArray
    states: FloatArray
    reference: FloatArray
    inputs: FloatArray
    ground: FloatArray


def select(sources: Sequence[Source], settings: Plot) -> Shown:
    """What the figure shows: the first car, as far as it went."""
    loop: ClosedLoop = sources[0].records["loop"]
    states = loop.states[0][np.isfinite(loop.states[0]).all(axis=1)]
    heading = np.concatenate([[0.0], np.cumsum(loop.dt * (states[1:, 2] + states[:-1, 2]) / 2)])
    c, s = np.cos(heading), np.sin(heading)
    speed = np.stack([c * states[:, 0] - s * states[:, 1], s * states[:, 0] + c * states[:, 1]], axis=1)
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(loop.dt * (speed[1:] + speed[:-1]) / 2, axis=0)])
    time = loop.dt * np.arange(float(len(states)))
    inputs = loop.inputs[0][: len(states) - 1]
    return Shown(time, states, loop.reference[: len(states)], inputs, np.column_stack([place, heading]))


def numbers(shown: Shown) -> Mapping[str, Array]:
    """Time, states, their reference, inputs, and the path."""
    columns = {"time": column(shown.time, "sample", "s"), **state_columns(shown.states, BODY, "sample")}
    columns |= state_columns(shown.reference, BODY, "sample", "reference/{}")
    columns |= state_columns(shown.inputs, INPUTS, "step")
    names = (("X", "m"), ("Y", "m"), ("heading", "rad"))
    return columns | {name: column(shown.ground[:, i], "sample", unit) for i, (name, unit) in enumerate(names)}


def draw(shown: Shown) -> Figure:
    """The path on top, below it the states and the inputs over time."""
    with style():
        figure = Figure(figsize=(COLUMN, PATH + 5 * PANEL + BESIDES), layout="constrained")
        ground, *panels = figure.subplots(6, 1, height_ratios=[PATH, *[PANEL] * 5])
        ground.plot(shown.ground[:, 0], shown.ground[:, 1], color=GUIDE, linewidth=0.8)
        for k in np.linspace(0, len(shown.ground) - 1, CARS).astype(int):
            ground.fill(*_outline(*shown.ground[k]), color=COLOURS[0], alpha=0.35, linewidth=0)
        ground.set_aspect("equal", adjustable="datalim")
        ground.set_xlabel("X (m)")
        ground.set_ylabel("Y (m)")
        for i, panel in enumerate(panels[:3]):
            panel.plot(shown.time, shown.reference[:, i], color=OTHERS[1], linestyle="--", linewidth=1)
            panel.plot(shown.time, shown.states[:, i], color=COLOURS[0])
            panel.set_ylabel(axis_label(BODY.names[i], BODY.units[i]))
        for panel, places, name in ((panels[3], (0, 2), "steer (rad)"), (panels[4], (1, 3), "slip (1)")):
            for place, colour in zip(places, COLOURS[:2], strict=True):
                panel.step(shown.time[:-1], shown.inputs[:, place], where="post", color=colour, linewidth=0.9)
            panel.set_ylabel(name)
        for panel in panels:
            panel.set_xlim(0, shown.time[-1])
            ticks(panel.yaxis, 3)
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
        panels[3].set_title("front blue, rear orange", loc="right", fontsize=7, color=GUIDE, pad=1)
        panels[-1].set_xlabel("time (s)")
    return figure


def _outline(X: float, Y: float, heading: float) -> tuple[FloatArray, FloatArray]:
    """The corners of a car, its nose pointed."""
    along = LENGTH * np.array([-0.5, 0.3, 0.5, 0.3, -0.5])
    across = WIDTH * np.array([-0.5, -0.5, 0.0, 0.5, 0.5])
    c, s = np.cos(heading), np.sin(heading)
    return X + c * along - s * across, Y + s * along + c * across
