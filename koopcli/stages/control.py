"""Stage ``control``: a scenario driven in a closed loop."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from koopcli.checks import restored
from koopcli.choices import SEED_LIMIT, setting, taken_from
from koopcli.control import scenarios
from koopcli.control.closed import ClosedLoop
from koopcli.control.control import TS
from koopcli.control.controllers import CONTROLLERS
from koopcli.control.controllers.controller import ControllerChoice, Weighted
from koopcli.control.controllers.generator import GeneratorControl
from koopcli.control.driven import driven
from koopcli.control.loop import CALM, Disturbances, Noise, close
from koopcli.control.scenarios import Scenario
from koopcli.errors import InvalidValueError
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task
from koopcli.vehicles.axles import COMBINED_HELP, Combined
from koopcli.vehicles.parameters import VehicleParameters

CLOCK = time.process_time  # of the controller's steps; a test may stop it
STEP = 5e-3  # seconds that a step of one car takes, with its plant
RANDOM = 60  # states of the scenario random, unless told otherwise


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A scenario, a controller, and the plant that it drives."""

    vehicle: VehicleParameters = taken_from("vehicle")
    driven: VehicleParameters = taken_from("vehicle")
    scenario: str = setting(help="what is to be driven")
    controller: ControllerChoice = setting(GeneratorControl(), help="what drives")
    plant: Literal["wheels", "slips"] = setting("wheels", help="equations of motion of the car")
    combined: Combined = setting("ellipse", help=COMBINED_HELP)
    seconds: float | None = setting(None, above=0, high=1e4, unit="s", help="length; else that of the scenario")
    seed: int = setting(scenarios.SEED, low=0, high=SEED_LIMIT, help="of random states and of noise")
    count: int = setting(RANDOM, low=1, high=100_000, help="states of the scenario random")
    noise: float = setting(
        0.0, low=0, high=100, unit="m/s", help="on measured velocities, a tenth in rad/s on yaw rate"
    )
    delay: int = setting(0, low=0, high=1000, help="samples that inputs come late")
    x0: tuple[float, ...] = setting((), empty=True, help="of a scenario of one's own")
    reference: tuple[tuple[float, ...], ...] = setting((), empty=True, help="of a scenario of one's own")


def scenario_of(settings: Loop) -> Scenario:
    """The scenario. Raises ``InvalidValueError`` for numbers of one's own that do not fit."""
    name = settings.scenario
    if settings.x0:
        reference = settings.reference if len(settings.reference) > 1 else settings.reference[0]
        scenario = scenarios.own(settings.x0, settings.seconds or 5.0, reference)
    elif name == "random":
        scenario = scenarios.random(settings.vehicle, settings.seed, settings.count)
    else:
        scenario = scenarios.SCENARIOS[name](settings.vehicle)
    return scenario if settings.seconds is None else scenarios.lasting(scenario, settings.seconds)


def _run(settings: Loop, inputs: Inputs, context: Context) -> ClosedLoop:
    scenario, kind = scenario_of(settings), settings.controller
    if isinstance(kind, Weighted) and kind.weights == Weighted.weights:
        kind = replace(kind, weights=scenario.weights(front_only=kind.steer_rear == 0))
    plant = driven(settings.plant, settings.driven, settings.vehicle, settings.combined)
    noise = Noise(settings.noise, settings.noise / 10, settings.seed) if settings.noise else None
    disturbances = Disturbances(noise, settings.delay) if noise or settings.delay else CALM
    controls = [kind.of(settings.vehicle, inputs.get("predictor")) for _ in scenario.x0]
    controls[0].step(scenario.x0[0], scenario.reference(np.asarray(controls[0].times)))  # tables are built with it
    runs = close(controls, plant, scenario.x0, scenario.seconds, scenario.reference, disturbances, CLOCK)
    steps = round(scenario.seconds / TS)
    reference = scenario.reference(TS * np.arange(steps + 1.0))
    result = ClosedLoop.of(runs, steps, reference, dt=TS, solves=kind.solves, tracks=scenario.tracking)
    if result.unsolved.any():
        context.warn(
            f"{int(result.unsolved.sum())} of {result.inputs.shape[0] * steps} programmes were not solved: the plan "
            "before was kept there"
        )
    for text in sorted({text for text in result.ended if text}):
        context.warn(f"a car ended early: {text}")
    return result


def _describe(figures: Meta, settings: Loop) -> str:
    share = f"{100 * figures['settled_share']:.3g} % settled"
    if figures["cars"] == 1:
        settled = figures["settled"][0]
        share = "never settled" if settled is None else f"settled after {settled:.2f} s"
    text = f"{settings.scenario} by {settings.controller.kind}: {share}, J {figures['cost']['mean']:.4g}"
    if figures["rms"] is not None:
        text += f", errors {figures['rms']['yaw_rate']:.3g} rad/s and {figures['rms']['offset']:.2g} m to the side"
    return f"{text}; {figures['step_ms']['median']:.2g} ms a step"


def _check(task: Task) -> None:
    settings: Loop = task.settings
    scenario_of(settings)
    driven(settings.plant, settings.driven, settings.vehicle, settings.combined)
    needs = bool(type(settings.controller).dynamics)
    if needs != any(role == "predictor" for role, _ in task.inputs):
        raise InvalidValueError(
            f"the controller '{settings.controller.kind}' needs {'a' if needs else 'no'} predictor: "
            f"{'name one with --predictor' if needs else 'leave out --predictor'}"
        )
    if not needs:
        settings.controller.of(settings.vehicle)


def _estimate(task: Task) -> Cost:
    scenario = scenario_of(task.settings)
    cars, steps = len(scenario.x0), scenario.seconds / TS
    return Cost(STEP * cars * steps, 64.0 * cars * steps)


__all__ = ["CONTROLLERS", "STAGE", "Loop", "scenario_of"]

STAGE = Stage(
    name="control",
    version=1,
    settings=lambda values: restored(Loop, values),
    run=_run,
    unpack=ClosedLoop.unpack,
    figures=ClosedLoop.figures,
    describe=_describe,
    check=_check,
    estimate=_estimate,
)
