"""One simulated trajectory: its path on the ground, its states and its inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.colours import COLOURS, GUIDE
from koopcli.figures.drawing import Source, column, state_columns
from koopcli.figures.style import COLUMN, axis_label, looks, style
from koopcli.records import ENDS, Array, Channels, FloatArray, Trajectories

RIM = {"wheel_rate_f": "front", "wheel_rate_r": "rear"}
HEADINGS = 12  # cars drawn along the path


@dataclass(frozen=True)
class Path:
    """``x`` (samples, n_x) at ``time`` (samples,) in s under ``u`` (samples - 1, n_u); ``ground`` (samples, 3): where
    the centre of gravity is in m, and the heading in rad; ``lateral`` (samples,) acceleration in m/s²; ``rim``: speed
    of the rim in m/s of every wheel that has a rate; ``end``: why it ended early, if it did.
    """

    time: FloatArray
    x: FloatArray
    u: FloatArray
    ground: FloatArray
    lateral: FloatArray
    rim: Mapping[str, FloatArray]
    end: str
    state_channels: Channels
    input_channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> Path:
    """What the figure shows. Raises ``InvalidValueError`` for a number of which there is no trajectory."""
    t: Trajectories = sources[0].records["trajectories"]
    number = settings.trajectory
    assert number is not None
    if number >= len(t):
        raise InvalidValueError(f"'plot.trajectory' is counted from 0 to {len(t) - 1} here, got {number}")
    steps, end = t.steps, ""
    if t.course is not None and t.course.reason[number]:
        steps, end = int(t.course.steps[number]), ENDS[t.course.reason[number]]
    if steps == 0:
        raise InvalidValueError(f"trajectory {number} {end} at its first sample: there is nothing to draw")
    x, u = np.asarray(t.x[number])[: steps + 1], np.asarray(t.u[number])[:steps]
    radius = t.plant.get("vehicle", {}).get("r_w") or np.nan
    names = t.state_channels.names
    return Path(
        time=t.dt * np.arange(steps + 1.0),
        x=x,
        u=u,
        ground=_ground(x, t.dt),
        lateral=np.gradient(x[:, 1], t.dt) + x[:, 2] * x[:, 0],
        rim={label: radius * x[:, names.index(name)] for name, label in RIM.items() if name in names},
        end=end,
        state_channels=t.state_channels,
        input_channels=t.input_channels,
    )


def _ground(x: FloatArray, dt: float) -> FloatArray:
    """Place and heading from the velocity in the car's axes and the yaw rate, by the trapezoidal rule."""
    heading = _summed(x[:, 2], dt)
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([_summed(c * x[:, 0] - s * x[:, 1], dt), _summed(s * x[:, 0] + c * x[:, 1], dt), heading], axis=1)


def _summed(rate: FloatArray, dt: float) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(dt * (rate[1:] + rate[:-1]) / 2)])


def numbers(shown: Path) -> Mapping[str, Array]:
    """Time, place, states and lateral acceleration; the inputs, each from its own sample on."""
    return {
        "time": column(shown.time, "sample", "s"),
        "X": column(shown.ground[:, 0], "sample", "m"),
        "Y": column(shown.ground[:, 1], "sample", "m"),
        "heading": column(shown.ground[:, 2], "sample", "rad"),
        **state_columns(shown.x, shown.state_channels, "sample"),
        "lateral acceleration": column(shown.lateral, "sample", "m/s^2"),
        **state_columns(shown.u, shown.input_channels, "step"),
    }


def draw(shown: Path) -> Figure:
    """The path from above with the car along it, then one panel for each state of the body, and for inputs by unit."""
    units = list(dict.fromkeys(shown.input_channels.units))
    rows = 5 + len(units)
    with style():
        figure = Figure(figsize=(COLUMN, 1.5 + 0.8 * (rows - 1)), layout="constrained")
        panels = figure.subplots(rows, height_ratios=[1.6, *([1] * (rows - 1))])
        _draw_path(panels[0], shown)
        speed, across, yaw, side, *inputs = panels[1:]
        for axes in panels[2:]:
            axes.sharex(speed)
        speed.plot(shown.time, shown.x[:, 0], label="car", color=COLOURS[0])
        for (label, rim), look in zip(shown.rim.items(), looks(3)[1:], strict=False):
            speed.plot(shown.time, rim, label=f"{label} rim", **look)
        for axes, i in ((across, 1), (yaw, 2)):
            axes.plot(shown.time, shown.x[:, i], color=COLOURS[0])
        side.plot(shown.time, shown.lateral, color=COLOURS[0])
        for i, axes in enumerate((speed, across, yaw)):
            axes.set_ylabel(_two_lines(shown.state_channels.names[i], shown.state_channels.units[i]))
        side.set_ylabel(_two_lines("a_y", "m/s²"))
        for axes, unit in zip(inputs, units, strict=True):
            _draw_inputs(axes, shown, unit)
        for axes in (speed, *inputs):
            if len(axes.lines) > 1:
                axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        for axes in panels[1:-1]:
            axes.tick_params(labelbottom=False)
        panels[-1].set_xlabel("time (s)")
        figure.align_ylabels(panels[1:])
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # the solver's last digits move from run to run with so many panels
        for axes in panels:
            axes.set_position(np.round(axes.get_position(original=True).bounds, 5))
    return figure


def _draw_path(axes: Axes, shown: Path) -> None:
    X, Y, heading = shown.ground.T
    axes.plot(X, Y, color=COLOURS[0])
    for k in np.unique(np.linspace(0, len(X) - 1, HEADINGS).astype(int)):
        nose = (3, 0, np.rad2deg(heading[k]) - 90)  # a triangle that points ahead
        axes.plot(X[k], Y[k], marker=nose, color=COLOURS[1], markersize=5)
    axes.plot(X[0], Y[0], "o", color=GUIDE, markersize=2.5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("X (m)")
    axes.set_ylabel("Y (m)")
    if shown.end:
        axes.set_title(f"ends at {shown.time[-1]:.2f} s: it {shown.end}", fontsize=7)


def _draw_inputs(axes: Axes, shown: Path, unit: str) -> None:
    """Inputs of one unit as steps; those that never move are left out beside others that do."""
    channels = list(zip(shown.input_channels.names, shown.input_channels.units, shown.u.T, strict=True))
    alike = [(name, values) for name, u, values in channels if u == unit]
    moving = [(name, values) for name, values in alike if values.any()] or alike[:1]
    for (name, values), look in zip(moving, looks(len(moving)), strict=True):
        axes.step(shown.time, np.append(values, values[-1]), where="post", label=name.replace("_", " "), **look)
    if len(moving) == 1:
        axes.set_ylabel(_two_lines(moving[0][0], unit))
    else:
        axes.set_ylabel(_two_lines("input", unit))


def _two_lines(name: str, unit: str) -> str:
    """A label that is no longer than a low panel."""
    return axis_label(name, unit).replace(" (", "\n(")
