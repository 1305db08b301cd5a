"""The command that closes a loop."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from koopcli.checks import candidates
from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import Invocation, begin
from koopcli.cli.options import DryRunOption, JsonOption, StoreOption, VehicleOption
from koopcli.cli.outputs import STDOUT, CsvOption, check_outputs, write_outputs
from koopcli.console import show_table
from koopcli.errors import InvalidValueError, UnknownNameError, UsageError
from koopcli.parsing import parse_toml

if TYPE_CHECKING:
    from koopcli.config.changes import Values
    from koopcli.stages.base import Task
    from koopcli.stages.control import Loop
    from koopcli.stages.pipeline import Artefact
    from koopcli.vehicles.parameters import VehicleParameters

NAMES = ("spin", "drift-left", "drift-right", "reverse-slide", "fast-spin", "random", "yaw-step", "lane-change")
CONTROLLERS = ("generator", "eigen", "equations", "ltv", "rti", "esc", "none")


def control(
    scenario: Annotated[str, typer.Argument(metavar="|".join([*NAMES, "FILE.toml"]), help="What is to be driven.")],
    controller: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(CONTROLLERS),
            help="What drives: generator and eigen plan with a predictor, equations, ltv and rti with the equations of "
            "the car, esc is proportional, none does nothing (generator, or as the predictor is).",
        ),
    ] = None,
    predictor: Annotated[
        str | None,
        typer.Option(autocompletion=complete_name, help="The predictor; made when left out and one is needed."),
    ] = None,
    plant: Annotated[str, typer.Option(metavar="wheels|slips", help="Equations of motion of the car.")] = "wheels",
    vehicle: VehicleOption = None,
    front_steer: Annotated[bool, typer.Option("--front-steer", help="Steer in front only.")] = False,
    noise: Annotated[
        float, typer.Option(metavar="S", help="Noise on measured velocities in m/s, a tenth in rad/s on the yaw rate.")
    ] = 0.0,
    delay: Annotated[int, typer.Option(metavar="N", help="Samples that inputs come late.")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of random states and of noise.")] = 21,
    count: Annotated[int, typer.Option(metavar="N", help="How many states the scenario random has.")] = 60,
    seconds: Annotated[float | None, typer.Option(metavar="S", help="Length; else that of the scenario.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="plant.KEY=VALUE",
            help="Change the car that is driven and not what the controller knows, such as plant.mu_scale=0.7.",
        ),
    ] = None,
    csv_: CsvOption = None,
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Drive a scenario in a closed loop: recover from a spin, change lanes.

    A controller on a predictor plans forces of the axles over half a second within what the tyres can give, and finds
    the steer angles and slips that give them. The equations of the car in the same controller, a linearisation and a
    proportional controller stand beside it. The loop is closed on a car with wheels, never on the predictor.
    Controllers that plan need the extra: pip install 'koopcli[control]'.

    Example: koop control spin --controller ltv
    """
    check_outputs(None, csv_, as_json=as_json)
    if controller is not None and controller not in CONTROLLERS:
        raise UnknownNameError(f"unknown controller '{controller}'{candidates(controller, CONTROLLERS)}")
    own: Values = {"vehicle": {"name": vehicle}} if vehicle is not None else {}
    call = begin(store, "paper", None, ("vehicle",), own)
    of = call.optional(predictor, ("fit-edmd", "fit-eigen"), "--predictor", ("vehicle",))
    task = _task(call, scenario, controller, of, set_ or [])
    settings = replace(task.settings, plant=plant, noise=noise, delay=delay, seed=seed, count=count)
    if front_steer:
        settings = replace(settings, controller=replace(settings.controller, steer_rear=0.0))
    if seconds is not None:
        settings = replace(settings, seconds=seconds)
    task = replace(task, settings=_checked(settings))

    def shown(artefact: Artefact) -> None:
        write_outputs(call.console, b"", None, artefact.content, csv_)
        if not as_json:
            _show(artefact)

    call.run(lambda experiment: task, as_json=as_json, dry_run=dry_run, extra=shown, table_out=csv_ == STDOUT)


def _task(call: Invocation, scenario: str, controller: str | None, of: Task | None, changes: Sequence[str]) -> Task:
    """The loop with its predictor."""
    from koopcli.config.shipped import vehicle_named
    from koopcli.stages.base import Task as Planned
    from koopcli.stages.control import CONTROLLERS as KINDS
    from koopcli.stages.control import Loop

    named = call.changes.get("vehicle", {}).get("name") if call.changes else None
    vehicle = call.experiment.vehicle
    if of is not None and named is None:
        simulation = call.simulated(of)
        vehicle = simulation.vehicle
        if vehicle.r_w is None or of.stage == "fit-edmd":
            vehicle = vehicle_named("rimac-2018")
            call.console.note("the predictor is of a body: rimac-2018 is driven")
    elif named is None:
        vehicle = vehicle_named("rimac-2018")
    kind = controller or ("eigen" if of is not None and of.stage == "fit-eigen" else "generator")
    driven = _changed(vehicle, changes)
    values: Values = {"scenario": scenario, "vehicle": vehicle, "driven": driven, "controller": KINDS[kind]()}
    if scenario.endswith(".toml"):
        values |= _own(Path(scenario))
    elif scenario not in NAMES:
        raise UnknownNameError(f"unknown scenario '{scenario}'{candidates(scenario, NAMES)}")
    if of is None and kind in ("generator", "eigen"):
        of = _made(kind, vehicle)
    needed = of is not None and kind in ("generator", "eigen")
    return Planned("control", Loop(**values), (("predictor", of),) if needed and of is not None else ())


def _made(kind: str, vehicle: VehicleParameters) -> Task:
    """The predictor that a controller of a ``kind`` needs for a ``vehicle``."""
    from koopcli.config.experiment import load_experiment
    from koopcli.koopman.edmd.fit import FitEdmd
    from koopcli.stages import recipes

    if kind == "generator":
        experiment = load_experiment("paper", {})
        experiment = replace(experiment, simulate=replace(experiment.simulate, vehicle=vehicle))
        fit = FitEdmd.of(basis="anisotropic", order=8, terms="generator")
        of_body: Task = recipes.fit_edmd(replace(experiment, fit_edmd=fit))
        return of_body
    experiment = load_experiment(recipes.QUICK, {})
    coasting: Task = recipes.fit_eigen(replace(experiment, simulate=replace(experiment.simulate, vehicle=vehicle)))
    return coasting


def _changed(vehicle: VehicleParameters, assignments: Sequence[str]) -> VehicleParameters:
    """The vehicle with what ``--set plant.KEY=VALUE`` changes of it."""
    from koopcli.checks import COMMAND_LINE
    from koopcli.config.changes import toml_value
    from koopcli.vehicles.parameters import change

    changes: Values = {}
    for text in assignments:
        name, _, raw = (part.strip() for part in text.partition("="))
        if not name.startswith("plant.") or not raw:
            raise UsageError(f"--set {text}: plant.KEY=VALUE was expected, such as plant.mu_scale=0.7")
        table, _, key = name.removeprefix("plant.").rpartition(".")
        within = changes.setdefault(table, {}) if table else changes
        within[key] = toml_value(raw)
    return change(vehicle, changes, COMMAND_LINE) if changes else vehicle


def _own(path: Path) -> dict[str, Any]:
    """A scenario of one's own from a TOML file."""
    try:
        values = parse_toml(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InvalidValueError(f"cannot read the scenario {path}: {error}") from error
    unknown = [key for key in values if key not in ("x0", "seconds", "reference")]
    if unknown or "x0" not in values:
        raise InvalidValueError(f"{path} must have x0, and may have seconds and reference, got {', '.join(values)}")
    reference = values.get("reference", [15.0, 0.0, 0.0])
    if isinstance(reference, str):
        reference = _rows(path.parent / reference)
    rows = reference if reference and isinstance(reference[0], (list, tuple)) else [reference]
    told = {"scenario": "own", "x0": tuple(values["x0"]), "reference": tuple(tuple(row) for row in rows)}
    return {**told, "seconds": float(values.get("seconds", 5.0))}


def _rows(path: Path) -> list[list[float]]:
    try:
        return [[float(value) for value in row] for row in np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)]
    except (OSError, ValueError) as error:
        raise InvalidValueError(
            f"cannot read the reference {path}: {error}; t,v_x,v_y,yaw_rate were expected"
        ) from error


def _checked(settings: Loop) -> Loop:
    from koopcli.checks import restored
    from koopcli.choices import written

    return restored(type(settings), written(settings))


def _show(artefact: Artefact) -> None:
    figures = artefact.figures
    settled = [value for value in figures["settled"] if value is not None]
    rows = [
        ["settled", f"{len(settled)} of {figures['cars']}"],
        ["settle time, the longest", f"{max(settled):.2f} s" if settled else "never"],
        ["J, mean", f"{figures['cost']['mean']:.4g}"],
        [
            "a step of the controller",
            f"{figures['step_ms']['median']:.2g} ms, {figures['step_ms']['p99']:.2g} at most but for 1 %",
        ],
        ["steps not solved", str(figures["unsolved"])],
    ]
    if figures["rms"] is not None:
        rows += [[f"error of {name}", f"{value:.4g}"] for name, value in figures["rms"].items()]
    show_table(["what", "value"], rows, left=2, file=sys.stderr)


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("control")(control)
