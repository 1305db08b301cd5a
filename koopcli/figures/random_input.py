"""One trajectory under random inputs, with the prediction started afresh from the true state every so often."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures.kit.figure import FigureKind, Source, column, state_columns
from koopcli.figures.kit.style import COLOURS, COLUMN, GUIDE, Figure, axis_label, style
from koopcli.koopman.scores.metrics import rmse
from koopcli.koopman.scores.restarts import restarted
from koopcli.records import Array, Channels, FloatArray, Trajectories

FIGURE = FigureKind(
    about="one trajectory under random inputs, true and predicted, with restarts",
    takes="predictor",
    behind=("trajectories",),
    told={"restart": lambda recipes, experiment, artefacts: experiment.plot.restart},
    usual="fit-edmd",
)

MARKED = 15  # restarts that are marked by lines; more would hide what is drawn


@dataclass(frozen=True)
class RandomInput:
    """``true`` (samples, n_x) at ``time`` (samples,) in s; for each segment its ``starts`` in samples, the
    ``predicted`` states (samples of it, n_x), and its ``rmse`` in percent, the known start aside.
    """

    time: FloatArray
    true: FloatArray
    starts: tuple[int, ...]
    predicted: tuple[FloatArray, ...]
    rmse: FloatArray
    channels: Channels


def select(sources: Sequence[Source], settings: Plot) -> RandomInput:
    """What the figure shows. Raises ``InvalidValueError`` where a prediction leaves the finite numbers."""
    predictor, test = sources[0].records["predictor"], sources[0].records["trajectories"].finished()
    assert isinstance(test, Trajectories)
    assert settings.restart is not None
    x, u = np.asarray(test.x[:1]), np.asarray(test.u[:1])
    starts, segments = restarted(predictor, x, u, settings.restart)
    if not all(np.isfinite(segment).all() for segment in segments):
        raise InvalidValueError(
            f"a prediction over {settings.restart} steps leaves the finite numbers: restart it more often with "
            "--set plot.restart=…"
        )
    score = [
        float(rmse(segment[:, 1:], x[:, k + 1 : k + segment.shape[1]])[0])
        for k, segment in zip(starts, segments, strict=True)
    ]
    time = test.dt * np.arange(test.steps + 1.0)
    predicted = tuple(segment[0] for segment in segments)
    return RandomInput(time, x[0], tuple(starts), predicted, np.array(score), test.state_channels)


def numbers(shown: RandomInput) -> Mapping[str, Array]:
    """Time and true states; then the segments one after another, each with its own start; the RMSE of each."""
    lengths = [len(segment) for segment in shown.predicted]
    joined = np.concatenate(shown.predicted)
    time = np.concatenate([shown.time[k : k + n] for k, n in zip(shown.starts, lengths, strict=True)])
    return {
        "time": column(shown.time, "sample", "s"),
        **state_columns(shown.true, shown.channels, "sample", "{}/true"),
        "segment": column(np.repeat(np.arange(len(lengths)), lengths), "predicted_sample", "1"),
        "segment time": column(time, "predicted_sample", "s"),
        **state_columns(joined, shown.channels, "predicted_sample", "{}/predicted"),
        "segment rmse": column(shown.rmse, "segment", "%"),
    }


def draw(shown: RandomInput) -> Figure:
    """One panel for each state; a line marks every restart."""
    n_x, few = len(shown.channels), len(shown.starts) <= MARKED
    with style():
        figure = Figure(figsize=(COLUMN, 1.15 * n_x + 0.7), layout="constrained")
        panels = figure.subplots(n_x, sharex=True)
        for i, axes in enumerate(panels):
            for k in shown.starts[1:] if few else ():
                axes.axvline(shown.time[k], color=GUIDE, linewidth=0.6, linestyle=(0, (1, 2)), zorder=1)
            axes.plot(shown.time, shown.true[:, i], "-", color=COLOURS[0], label="true")
            for k, segment in zip(shown.starts, shown.predicted, strict=True):
                label = "predicted, started afresh at each dot" if k == 0 else None
                axes.plot(shown.time[k : k + len(segment)], segment[:, i], "--", color=COLOURS[1], label=label)
                axes.plot(shown.time[k], segment[0, i], "o", color=COLOURS[1], markersize=3 if few else 1)
            axes.set_ylabel(axis_label(shown.channels.names[i], shown.channels.units[i]))
            axes.grid(visible=False, axis="x")
        panels[-1].set_xlabel("time (s)")
        figure.align_ylabels()
        handles, labels = panels[0].get_legend_handles_labels()
        title = f"RMSE {shown.rmse[0]:.3g} %"
        if len(shown.rmse) > 1:
            smallest, largest = shown.rmse.min(), shown.rmse.max()
            title = f"RMSE of a segment {smallest:.3g} … {largest:.3g} % (mean {shown.rmse.mean():.3g} %)"
        figure.legend(handles, labels, loc="outside lower center", ncols=2, title=title)
    return figure
