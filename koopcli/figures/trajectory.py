"""One simulated trajectory: its course on the ground, and its states and inputs as far as they change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.config.pictures import Cone, Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Recipes, Source, Task, column, state_columns
from koopcli.figures.kit.style import COLOURS, COLUMN, SMALLEST, Axes, Figure, axis_label, looks, style, symbol, ticks
from koopcli.records import ENDS, Array, Channels, FloatArray, Trajectories
from koopcli.simulation.manoeuvres import MANOEUVRES
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample


def _cones(recipes: Recipes, experiment: Experiment, artefacts: Sequence[Task]) -> tuple[Cone, ...]:
    """Those of the manoeuvre that the trajectories drive, where it has any; to the other side for a negative scale."""
    samples = [sample.settings for task in artefacts if (sample := task.find("sample")) is not None]
    driven = [sample for sample in samples if isinstance(sample, ManoeuvreSample)]
    return tuple(Cone(X, Y if drive.scale >= 0 else -Y) for drive in driven for X, Y in MANOEUVRES[drive.name].cones)


FIGURE = FigureKind(
    about="one simulated trajectory: course, states and inputs",
    takes="trajectories",
    told={
        "trajectory": lambda recipes, experiment, artefacts: experiment.plot.trajectory,
        "cones": _cones,
    },
    makes=lambda recipes, experiment: [recipes.simulation(experiment, recipes.sample(experiment.sample("manoeuvre")))],
)

RIM = {"wheel_rate_f": "front", "wheel_rate_r": "rear"}
HEADINGS = 12  # cars drawn along the course
STRETCHED = 4.0  # how many times larger a flat course is drawn across than along
FLAT = 1 / 8  # height over width of a course that is stretched
STILL = 1e-9  # of its size: what moves less is constant
WIDTH, LOW, HIGH = 2.9, 0.55, 1.8  # inches: of the course, and its height at least and at most
PANEL, BESIDES = 0.62, 0.8  # inches: the height of a panel, and of what is around them


@dataclass(frozen=True)
class Path:
    """``x`` (samples, n_x) at ``time`` (samples,) in s under ``u`` (samples - 1, n_u); ``ground`` (samples, 3): where
    the centre of gravity is in m, and the heading in rad; ``lateral`` (samples,) acceleration in m/s²; ``rim``: speed
    of the rim in m/s of every wheel that has a rate; ``cones`` (c, 2) of the course in m; ``end``: why it ended early,
    if it did.
    """

    time: FloatArray
    x: FloatArray
    u: FloatArray
    ground: FloatArray
    lateral: FloatArray
    rim: Mapping[str, FloatArray]
    cones: FloatArray
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
        cones=np.array([(cone.X, cone.Y) for cone in settings.cones]).reshape(-1, 2),
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
    """Time, place, states, lateral acceleration; the inputs, each from its own sample on; cones, if there are any."""
    return {
        "time": column(shown.time, "sample", "s"),
        "X": column(shown.ground[:, 0], "sample", "m"),
        "Y": column(shown.ground[:, 1], "sample", "m"),
        "heading": column(shown.ground[:, 2], "sample", "rad"),
        **state_columns(shown.x, shown.state_channels, "sample"),
        "lateral acceleration": column(shown.lateral, "sample", "m/s^2"),
        **state_columns(shown.u, shown.input_channels, "step"),
        **{f"cone {name}": column(at, "cone", "m") for name, at in zip("XY", shown.cones.T, strict=True) if len(at)},
    }


@dataclass(frozen=True)
class _Panel:
    """Lines over time by what they are called, with the ``name`` and the ``unit`` of all; ``held``: as steps."""

    name: str
    unit: str
    lines: Mapping[str, FloatArray]
    held: bool = False

    @property
    def moving(self) -> dict[str, FloatArray]:
        """The lines that change."""
        return {name: v for name, v in self.lines.items() if np.ptp(v) > STILL * np.abs(v).max()}


def draw(shown: Path) -> Figure:
    """The course from above with the car along it, then a panel for each state of the body and for inputs by unit;
    what never changes has none.
    """
    every = _panels(shown)
    panels = [panel for panel in every if panel.moving]
    reach = np.concatenate([shown.ground[:, :2], shown.cones])
    across, up = np.maximum(np.ptp(reach, axis=0), 1e-3) * [1.1, 1.44]
    stretched = STRETCHED if up < FLAT * across else 1.0
    high = float(np.clip(WIDTH * stretched * up / across, LOW, HIGH))
    with style():
        figure = Figure(figsize=(COLUMN, high + PANEL * len(panels) + BESIDES), layout="constrained")
        course, *axes_of = figure.subplots(1 + len(panels), height_ratios=[high, *([PANEL] * len(panels))])
        _draw_course(course, shown, stretched)
        course.set_title("\n".join(_notes(shown, every)), fontsize=SMALLEST)
        for axes, panel in zip(axes_of, panels, strict=True):
            axes.sharex(axes_of[0]) if axes is not axes_of[0] else None
            axes.tick_params(labelbottom=axes is axes_of[-1])
            _draw_panel(axes, shown.time, panel)
        if axes_of:
            axes_of[-1].set_xlabel("time (s)")
        figure.align_ylabels(axes_of)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # the solver's last digits move from run to run with so many panels
        for axes in (course, *axes_of):
            axes.set_position(np.round(axes.get_position(original=True).bounds, 5))
    return figure


def _panels(shown: Path) -> list[_Panel]:
    """What there is to draw over time, moving or not."""
    names, units = shown.state_channels.names, shown.state_channels.units
    body = [{"car": shown.x[:, 0], **{f"{label} rim": v for label, v in shown.rim.items()}}]
    body += [{names[i]: shown.x[:, i]} for i in (1, 2)]
    panels = [_Panel(names[i], units[i], lines) for i, lines in enumerate(body)]
    panels.append(_Panel("a_y", "m/s²", {"a_y": shown.lateral}))
    inputs = list(zip(shown.input_channels.names, shown.input_channels.units, shown.u.T, strict=True))
    for unit in dict.fromkeys(shown.input_channels.units):
        lines = {name: np.append(u, u[-1]) for name, measure, u in inputs if measure == unit}
        panel = _Panel("input", unit, lines, held=True)
        moving = list(panel.moving)
        panels.append(_Panel(moving[0], unit, lines, held=True) if len(moving) == 1 else panel)
    return panels


def _notes(shown: Path, panels: Sequence[_Panel]) -> list[str]:
    """What is said above the course: why it ends, and what is held constant other than at zero."""
    notes = [f"ends at {shown.time[-1]:.2f} s: it {shown.end}"] if shown.end else []
    held: dict[str, list[str]] = {}
    for panel in panels:
        for name in (name for name in panel.lines if name not in panel.moving):
            if value := panel.lines[name][0]:
                held.setdefault(f"{value:.3g} {panel.unit}", []).append(symbol(name))
    constant = "; ".join(f"{', '.join(sorted(names))} {value}" for value, names in held.items())
    return [*notes, f"constant: {constant}"] if constant else notes


def _draw_course(axes: Axes, shown: Path, stretched: float) -> None:
    X, Y, heading = shown.ground.T
    axes.plot(X, Y, color=COLOURS[0])
    for k in np.unique(np.linspace(0, len(X) - 1, HEADINGS).astype(int)):
        seen = np.arctan2(stretched * np.sin(heading[k]), np.cos(heading[k]))
        nose = (3, 0, np.rad2deg(seen) - 90)  # a triangle that points ahead
        axes.plot(X[k], Y[k], marker=nose, color=COLOURS[0], markersize=5)
    axes.plot(*shown.cones.T, "^", color=COLOURS[1], markersize=3.5, markeredgewidth=0, zorder=3)
    axes.margins(y=0.22)
    axes.set_aspect(stretched, adjustable="datalim")
    axes.set_xlabel("X (m)")
    axes.set_ylabel("Y (m)" if stretched == 1 else f"Y, {stretched:g} : 1\n(m)")
    ticks(axes.yaxis, 4, steps=[1, 2, 5, 10])


def _draw_panel(axes: Axes, time: FloatArray, panel: _Panel) -> None:
    """The lines that change; those of several are named above them."""
    moving = panel.moving
    for (name, values), look in zip(moving.items(), looks(len(moving)), strict=True):
        axes.plot(time, values, drawstyle="steps-post" if panel.held else "default", label=symbol(name), **look)
    axes.set_ylabel(axis_label(panel.name, panel.unit).replace(" (", "\n("))
    ticks(axes.yaxis, 3, steps=[1, 2, 5, 10])
    if len(moving) > 1:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1, 1),
            ncols=len(moving),
            borderaxespad=0.1,
            borderpad=0,
            handlelength=1.6,
            columnspacing=1,
        )
