"""The single-track vehicle: a sketch of its states, forces and angles, with the signs that are used throughout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.figures.kit.figure import FigureKind, Source, column
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, PAPER, Axes, Figure, style
from koopcli.records import Array, FloatArray

FIGURE = FigureKind(about="the vehicle: states, forces and angles with their signs", takes="nothing")

FRONT, REAR = np.array([1.6, 0.0]), np.array([-1.6, 0.0])  # m, as all lengths here
STEER = {"f": np.deg2rad(20.0), "r": np.deg2rad(-20.0)}
V = np.array([0.85, 0.45])  # velocity at the centre of gravity, drawn as a length
YAW_RATE = 0.18  # that it turns with, so that the velocities of the wheels fit the picture
WHEEL = (0.62, 0.2)
HEAD = "-|>,head_width=0.16,head_length=0.34"
SMALL_HEAD = "-|>,head_width=0.1,head_length=0.2"
MOTION, FORCE, ANGLE = COLOURS[0], COLOURS[1], COLOURS[2]


@dataclass(frozen=True)
class Arrow:
    """An arrow from ``tail`` to ``head`` (2,), with its ``name`` written at ``text`` (2,)."""

    name: str
    tail: FloatArray
    head: FloatArray
    text: FloatArray
    colour: str


def select(sources: Sequence[Source], settings: Plot) -> list[Arrow]:
    """Velocities and forces of the sketch; a wheel's lateral force points against its sideways velocity."""
    across = np.array([0.0, 1.0])
    arrows = [
        Arrow("$v_x$", np.zeros(2), V * [1, 0], V * [1, 0] + [-0.05, -0.17], MOTION),
        Arrow("$v_y$", np.zeros(2), V * [0, 1], V * [0, 1] + [0.02, 0.14], MOTION),
        Arrow("$v$", np.zeros(2), V, V + np.array([0.1, 0.08]), MOTION),
    ]
    for axle, at in (("f", FRONT), ("r", REAR)):
        along = np.array([np.cos(STEER[axle]), np.sin(STEER[axle])])
        left = np.array([-along[1], along[0]])
        velocity = V + YAW_RATE * at[0] * across
        pull = -1 if velocity @ left > 0 else 1
        push = at + 0.56 * along
        side = at + 0.7 * pull * left
        arrows += [
            Arrow(f"$F_{{{axle},x}}$", at, push, push + 0.13 * along - 0.1 * left, FORCE),
            Arrow(f"$F_{{{axle},y}}$", at, side, side + 0.15 * pull * left, FORCE),
            Arrow(f"$v_{axle}$", at, at + velocity, at + velocity + [0.12, 0.05], MOTION),
        ]
    return arrows


def numbers(shown: Sequence[Arrow]) -> Mapping[str, Array]:
    """Tail and head of every arrow."""
    columns: dict[str, Array] = {}
    for arrow in shown:
        ends = np.array([arrow.tail, arrow.head])
        name = arrow.name.translate({ord(sign): None for sign in "${},"})
        columns[f"{name}/x"] = column(ends[:, 0], "tail_and_head", "m")
        columns[f"{name}/y"] = column(ends[:, 1], "tail_and_head", "m")
    return columns


def draw(shown: Sequence[Arrow]) -> Figure:
    """The vehicle from above, x forward and y to the left."""
    with style():
        figure = Figure(figsize=(COLUMN, 2.3), layout="constrained")
        axes = figure.subplots()
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(-2.35, 3.0)
        axes.set_ylim(-1.65, 1.3)
        axes.plot(*np.stack([REAR, FRONT]).T, color=PAPER, linewidth=1.5, zorder=2)
        for axle, at in (("f", FRONT), ("r", REAR)):
            _wheel(axes, at, STEER[axle])
        axes.plot(0, 0, "o", color="white", markeredgecolor=PAPER, markersize=6, zorder=6)
        axes.plot(0, 0, ".", color=PAPER, markersize=3, zorder=7)
        for arrow in shown:
            _arrow(axes, arrow)
        by_name = {arrow.name: arrow for arrow in shown}
        _angle(axes, FRONT, 0.0, STEER["f"], 1.12, r"$\delta_f$")
        _angle(axes, REAR, 0.0, STEER["r"], 1.05, r"$\delta_r$", along=STEER["r"])
        for axle, at, radius in (("f", FRONT, 0.66), ("r", REAR, 0.7)):
            head = by_name[f"$v_{axle}$"].head - at
            slip = float(np.arctan2(head[1], head[0]))
            _angle(axes, at, slip, STEER[axle], radius, rf"$\alpha_{axle}$", along=STEER[axle])
        _yaw_rate(axes)
        _dimensions(axes)
    return figure


def _point(at: FloatArray) -> tuple[float, float]:
    return float(at[0]), float(at[1])


def _wheel(axes: Axes, at: FloatArray, steer: float) -> None:
    from matplotlib.patches import FancyBboxPatch
    from matplotlib.transforms import Affine2D

    length, width = WHEEL
    shape = FancyBboxPatch(
        (-length / 2, -width / 2),
        length,
        width,
        boxstyle="round,pad=0,rounding_size=0.07",
        facecolor="#dddddd",
        edgecolor=PAPER,
        linewidth=0.9,
        zorder=3,
    )
    shape.set_transform(Affine2D().rotate(steer).translate(*at) + axes.transData)
    axes.add_patch(shape)


def _arrow(axes: Axes, arrow: Arrow) -> None:
    look = {"arrowstyle": HEAD, "color": arrow.colour, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", _point(arrow.head), _point(arrow.tail), arrowprops={**look, "linewidth": 1.3}, zorder=5)
    axes.text(*_point(arrow.text), arrow.name, color=arrow.colour, ha="center", va="center", zorder=8)


def _angle(axes: Axes, at: FloatArray, start: float, end: float, radius: float, name: str, along: float = 0.0) -> None:
    """An arc from one direction to another, the way in which the angle is positive, and a line ``along`` one."""
    from matplotlib.patches import Arc

    low, high = sorted((start, end))
    reach = (radius + 0.12) * np.array([np.cos(along), np.sin(along)])
    axes.plot(*np.stack([at, at + reach]).T, "--", color=GUIDE, linewidth=0.7, zorder=1)
    arc = Arc(_point(at), 2 * radius, 2 * radius, theta1=np.rad2deg(low), theta2=np.rad2deg(high), color=ANGLE)
    axes.add_patch(arc)
    rim = [at + radius * np.array([np.cos(a), np.sin(a)]) for a in (end - np.sign(end - start) * 0.04, end)]
    look = {"arrowstyle": SMALL_HEAD, "color": ANGLE, "shrinkA": 0, "shrinkB": 0, "linewidth": 0.8}
    axes.annotate("", _point(rim[1]), _point(rim[0]), arrowprops=look, zorder=5)
    middle = (start + end) / 2
    place = at + (radius + 0.16) * np.array([np.cos(middle), np.sin(middle)])
    axes.text(*_point(place), name, color=ANGLE, ha="center", va="center", zorder=8)


def _yaw_rate(axes: Axes) -> None:
    """An arc about the centre of gravity, turning to the left."""
    from matplotlib.patches import Arc

    radius, end = 0.5, np.deg2rad(165.0)
    axes.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=105, theta2=160, color=MOTION, linewidth=1.3))
    tip = radius * np.array([np.cos(end), np.sin(end)])
    before = radius * np.array([np.cos(end - 0.15), np.sin(end - 0.15)])
    look = {"arrowstyle": HEAD, "color": MOTION, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.3}
    axes.annotate("", _point(tip), _point(before), arrowprops=look, zorder=5)
    axes.text(-0.3, 0.62, "yaw rate", color=MOTION, ha="right", va="center")


def _dimensions(axes: Axes) -> None:
    """Distances of the axles, and the directions of x and y."""
    level = -1.3
    for start, end, name in ((REAR[0], 0.0, "$l_r$"), (0.0, FRONT[0], "$l_f$")):
        axes.annotate(
            "",
            (end, level),
            (start, level),
            arrowprops={"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0, "linewidth": 0.7},
        )
        axes.text((start + end) / 2, level - 0.06, name, ha="center", va="top")
    for x in (REAR[0], 0.0, FRONT[0]):
        axes.plot([x, x], [level - 0.1, -0.25], color=GUIDE, linewidth=0.5, zorder=0)
    corner = np.array([-2.2, 0.55])
    for step, name in ((np.array([0.5, 0.0]), "$x$"), (np.array([0.0, 0.5]), "$y$")):
        axes.annotate(
            "",
            _point(corner + step),
            _point(corner),
            arrowprops={"arrowstyle": "->", "shrinkA": 0, "shrinkB": 0, "linewidth": 0.8},
        )
        axes.text(*_point(corner + 1.25 * step), name, ha="center", va="center")
