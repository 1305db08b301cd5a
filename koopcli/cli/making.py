"""The commands that make data: sample, simulate."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from koopcli.cli import evaluating, fitting
from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import Invocation, begin
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
    WorkersOption,
    names,
)
from koopcli.config.changes import Values
from koopcli.config.driving import DriveSample, DriveTestSample, ManoeuvreName, ManoeuvreSample
from koopcli.config.plants import PlantName
from koopcli.config.sampled import Draw, Excitation, Kind, Mesh, Mirror
from koopcli.config.samples import BallSample, BoxSample, EllipsoidSample, GreedySample, GridSample, PointSample
from koopcli.config.settings import Combined, ForcePer, Simulate
from koopcli.console import show_table

if TYPE_CHECKING:
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact

SAMPLE = ("sample", "vehicle", "simulate")  # samples that simulate, or steer, take the period from the simulation
SIMULATE = fitting.DATA


def sample(
    kind: Annotated[
        Kind | None,
        typer.Argument(
            metavar=names(Kind),
            help="grid: the EDMD dataset (the default); box: test states for it; point: one state, the start of the "
            "paper's trajectory under random inputs; ellipsoid: Γ, the states of one kinetic energy that "
            "eigenfunctions start from; greedy: states inside it, each where data are missing; ball: test states "
            "inside it; drive and drive-test: cars under way on wheels, with torques and steer, to train and to test; "
            "manoeuvre: one car through the manoeuvre NAME.",
        ),
    ] = None,
    name: Annotated[
        ManoeuvreName | None,
        typer.Argument(metavar=names(ManoeuvreName), help=f"manoeuvre: which one ({ManoeuvreSample.name})."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help=f"Seed of every draw (grid: {GridSample.seed}, box: {BoxSample.seed}, point: {PointSample.seed}, "
            f"greedy: {GreedySample.seed}, ball: {BallSample.seed}, drive: {DriveSample.seed}, "
            f"drive-test: {DriveTestSample.seed})."
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            help=f"grid: values per state ({GridSample.count}); else states (box: {BoxSample.count}, "
            f"ellipsoid: {EllipsoidSample.count}, ball: {BallSample.count}, drive, drive-test: {DriveSample.count})."
        ),
    ] = None,
    draw: Annotated[
        Draw | None, typer.Option(metavar=names(Draw), help=f"grid: how values are chosen ({GridSample.draw}).")
    ] = None,
    excitation: Annotated[
        Excitation | None,
        typer.Option(
            metavar=names(Excitation),
            help=f"box, point: the inputs ({BoxSample.excitation}); also drive, drive-test ({DriveSample.excitation}).",
        ),
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help=f"box, point: inputs within ± amplitude, in N ({BoxSample.amplitude:g}).")
    ] = None,
    torque: Annotated[
        float | None,
        typer.Option(help=f"drive: drive or brake torque of a wheel at most, in N m ({DriveSample.torque:g})."),
    ] = None,
    steer: Annotated[
        float | None, typer.Option(help=f"drive: front steer at most, in rad ({DriveSample.steer:g}).")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="manoeuvre: speed at its beginning, in m/s (as its source has it).")
    ] = None,
    scale: Annotated[
        float | None, typer.Option(help=f"manoeuvre: factor on steer and torques ({ManoeuvreSample.scale:g}).")
    ] = None,
    energy: Annotated[
        float | None,
        typer.Option(help=f"ellipsoid, greedy, ball: (largest) kinetic energy in J ({EllipsoidSample.energy:g})."),
    ] = None,
    mesh: Annotated[
        Mesh | None, typer.Option(metavar=names(Mesh), help=f"ellipsoid: points on it ({EllipsoidSample.mesh}).")
    ] = None,
    shells: Annotated[
        int | None,
        typer.Option(help=f"ellipsoid: surfaces, from a quarter of its size to the whole ({EllipsoidSample.shells})."),
    ] = None,
    budget: Annotated[
        float | None,
        typer.Option(help=f"greedy: simulated seconds of all trajectories together ({GreedySample.budget:g})."),
    ] = None,
    mirror: Annotated[
        list[str] | None,
        typer.Option(
            metavar=names(Mirror),
            autocompletion=lambda: list(get_args(Mirror)),
            help="greedy: mirror images count as data too, as in fit-eigen. The option may be given twice.",
        ),
    ] = None,
    vehicle: VehicleOption = None,
    steps: Annotated[
        int | None,
        typer.Option(
            help=f"Steps of each trajectory (box: {BoxSample.steps}, point: {PointSample.steps}, "
            f"ellipsoid: {EllipsoidSample.steps}, greedy: {GreedySample.steps}, ball: {BallSample.steps}, "
            f"drive: {DriveSample.steps})."
        ),
    ] = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw or lay out initial states and inputs.

    Kinds by kinetic energy (ellipsoid, ball) take mass and yaw inertia from the vehicle, those of cars under way
    (drive, drive-test) take the radius of its wheels. Greedy simulates as it goes and a manoeuvre steers, so these take
    all of it. The other kinds depend on no vehicle.

    Example: koop sample manoeuvre sine-with-dwell --vehicle rimac-2018
    """
    given: Values = {
        "kind": kind,
        "name": name,
        "torque": torque,
        "steer": steer,
        "speed": speed,
        "scale": scale,
        "seed": seed,
        "count": count,
        "draw": draw,
        "excitation": excitation,
        "amplitude": amplitude,
        "energy": energy,
        "mesh": mesh,
        "shells": shells,
        "budget": budget,
        "mirror": mirror or None,
        "steps": steps,
    }
    call = begin(store, experiment, set_, SAMPLE, {"sample": given, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    call.run(recipes.sample(call.experiment.sample("grid")), as_json=as_json, dry_run=dry_run)


def simulate(
    sample: Annotated[
        str | None, typer.Argument(autocompletion=complete_name, help="A sample; made from the settings when left out.")
    ] = None,
    plant: Annotated[
        PlantName | None,
        typer.Option(
            metavar=names(PlantName),
            help="Equations of motion: tyre forces as inputs, tyres with slip and steer, or wheels with torque "
            "and steer (what the sample is for).",
        ),
    ] = None,
    vehicle: VehicleOption = None,
    steps: Annotated[
        int | None, typer.Option(help="Steps of each trajectory (as the sample says; 1 for a grid).")
    ] = None,
    dt: Annotated[float | None, typer.Option(help=f"Sampling period in s ({Simulate.dt}).")] = None,
    force_per: Annotated[
        ForcePer | None,
        typer.Option(metavar=names(ForcePer), help=f"forces: what an input force acts on ({Simulate.force_per})."),
    ] = None,
    combined: Annotated[
        Combined | None,
        typer.Option(
            metavar=names(Combined),
            help="slips, wheels: how forces along and across a wheel share its grip (slips: none, wheels: ellipse).",
        ),
    ] = None,
    reference: Annotated[
        bool | None,
        typer.Option(
            "--reference",
            help="Integrate by a solver that controls its error, slowly, and say how far the usual integration is off.",
        ),
    ] = None,
    workers: WorkersOption = 1,
    cluster: ClusterOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate trajectories of a vehicle from a sample.

    Stiff plants choose the steps within a sample themselves. A trajectory that leaves the numbers that mean anything
    ends there, with its reason. An interrupted simulation goes on where it stopped.

    Example: koop simulate --plant wheels --vehicle my-car.toml
    """
    given: Values = {
        "plant": plant,
        "steps": steps,
        "dt": dt,
        "force_per": force_per,
        "combined": combined,
        "reference": reference,
    }
    call = begin(store, experiment, set_, SIMULATE, {"simulate": given, "vehicle": {"name": vehicle}}, workers, cluster)
    from koopcli.stages import recipes

    of = call.optional(sample, ["sample"], "the SAMPLE", ("simulate", "vehicle"))
    task = recipes.simulation(call.experiment, of)
    usual = [replace(task, settings=replace(task.settings, reference=False))] if task.settings.reference else []
    call.run(
        task,
        as_json=as_json,
        dry_run=dry_run,
        extra=lambda artefact: _compare(call, artefact, usual),
        also=usual,
    )


def _compare(call: Invocation, artefact: Artefact, usual: list[Task]) -> dict[str, Any]:
    """How far the ``usual`` integration is from that of the reference solver, as a table and as JSON."""
    if not usual:
        return {}
    from koopcli.simulation.reference import difference

    other = call.pipeline.make(usual[0])
    found = difference(other.content, artefact.content)
    rows = [[name, unit, f"{largest:.3g}", f"{root:.3g}"] for name, unit, largest, root in found]
    show_table(["usual − reference", "unit", "largest", "root mean square"], rows, left=2, file=sys.stderr)
    off = {name: {"max": largest, "rms": root, "unit": unit} for name, unit, largest, root in found}
    return {"compared": other.record.name, "difference": off}


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("sample", rich_help_panel="Make")(sample)
    app.command("simulate", rich_help_panel="Make")(simulate)
    fitting.register(app)
    evaluating.register(app)
