"""Stage ``predict``: one prediction, from a log or from a state that is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from koopcli.checks import build
from koopcli.choices import setting
from koopcli.errors import InvalidValueError
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.selection.forecast import SCORED, Forecast, from_log, from_state
from koopcli.logs.units import unit
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage


@dataclass(frozen=True)
class Predict:
    """Where a prediction starts and how long it is. Of one from a log: ``at`` and ``run``; else ``x0`` and ``u``."""

    seconds: float = setting(1.0, above=0, high=1e6, unit="s", help="length of the prediction")
    at: float | None = setting(None, low=-1e12, high=1e12, unit="s", help="start, after the first row of the recording")
    run: int = setting(0, low=0, high=1_000_000, help="recording of the log, counted from 0")
    x0: tuple[float, ...] = setting((), empty=True, help="first state, in SI")
    u: tuple[tuple[float, ...], ...] = setting((), empty=True, help="inputs, in SI: a row for each step")


def _run(settings: Predict, inputs: Inputs, context: Context) -> Forecast:
    predictor: Predictor = inputs["predictor"]
    steps = max(1, round(settings.seconds / predictor.dt))
    if not predictor.plant and steps * predictor.dt > SCORED + predictor.dt / 2:
        context.warn(f"errors are known up to {SCORED:g} s ahead: nothing says how good the prediction is beyond")
    log = inputs.get("trajectories")
    if log is not None:
        factors = {name: unit(text).factor for name, text in log.display.items()}
        assert settings.at is not None, "a prediction from a log has a time"
        return from_log(predictor, log.episodes, settings.at, steps, settings.run, log.display, factors)
    if len(settings.x0) != len(predictor.state_channels):
        raise InvalidValueError(
            f"x0 has {len(settings.x0)} numbers, the predictor the states {predictor.state_channels}: give one for each"
        )
    u = np.array(settings.u or [[0.0] * len(predictor.input_channels)] * steps, dtype=float)
    if u.shape[1] != len(predictor.input_channels):
        raise InvalidValueError(
            f"the inputs have {u.shape[1]} columns, the predictor the inputs {predictor.input_channels}: one for each"
        )
    low, high = predictor.coverage.domain
    outside = [
        f"{name} {value:g} (training {a:.3g} to {b:.3g})"
        for name, value, a, b in zip(predictor.state_channels.names, settings.x0, low, high, strict=True)
        if not a <= value <= b
    ]
    if outside:
        context.warn(f"x0 lies outside the states of training: {', '.join(outside)}")
    if not settings.u:
        context.warn("no inputs are given: they are taken to be zero")
    if predictor.needs_history:
        context.warn(f"no history: as if it had stood so for {predictor.memory * predictor.dt:g} s")
    return from_state(predictor, np.array(settings.x0), u)


def _describe(figures: Meta, settings: Predict) -> str:
    last = ", ".join(f"{name} {value:.4g}" for name, value in figures["last"].items())
    text = f"{figures['steps']} steps, at the end {last}"
    if figures["rmse"] is not None:
        text += "; RMSE to the log " + ", ".join(f"{name} {value:.3g}" for name, value in figures["rmse"].items())
    limited = figures["limited_share"]
    return f"{text}; {100 * limited:.0f} % of the inputs limited to their range in training" if limited else text


STAGE = Stage(
    name="predict",
    version=1,
    settings=lambda values: build(Predict, values),
    run=_run,
    unpack=Forecast.unpack,
    figures=Forecast.figures,
    describe=_describe,
    check=lambda task: None,
    estimate=lambda task: Cost(0.1, 1e4),
)
