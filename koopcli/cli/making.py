"""The commands that make data: sample, simulate."""

from __future__ import annotations

from typing import Annotated, get_args

import typer

from koopcli.cli import evaluating, fitting
from koopcli.cli.invocation import begin
from koopcli.cli.options import (
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
    complete_name,
    names,
)
from koopcli.config.changes import Values
from koopcli.config.plants import PlantName
from koopcli.config.samples import (
    BallSample,
    BoxSample,
    Draw,
    EllipsoidSample,
    Excitation,
    GreedySample,
    GridSample,
    Kind,
    Mesh,
    Mirror,
    PointSample,
)
from koopcli.config.settings import ForcePer, Simulate

SAMPLE = ("sample", "vehicle")
SIMULATE = fitting.DATA


def sample(
    kind: Annotated[
        Kind | None,
        typer.Argument(
            metavar=names(Kind),
            help="grid: the EDMD dataset (the default); box: test states for it; point: one state, the start of the "
            "paper's trajectory under random inputs; ellipsoid: Γ, the states of one kinetic energy that "
            "eigenfunctions start from; greedy: states inside it, each where data are missing; ball: test states "
            "inside it.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            help=f"Seed of every draw (grid: {GridSample.seed}, box: {BoxSample.seed}, point: {PointSample.seed}, "
            f"greedy: {GreedySample.seed}, ball: {BallSample.seed})."
        ),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(
            help=f"grid: values per state ({GridSample.count}); else states (box: {BoxSample.count}, "
            f"ellipsoid: {EllipsoidSample.count}, ball: {BallSample.count})."
        ),
    ] = None,
    draw: Annotated[
        Draw | None, typer.Option(metavar=names(Draw), help=f"grid: how values are chosen ({GridSample.draw}).")
    ] = None,
    excitation: Annotated[
        Excitation | None,
        typer.Option(metavar=names(Excitation), help=f"box, point: the inputs ({BoxSample.excitation})."),
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help=f"box, point: inputs within ± amplitude, in N ({BoxSample.amplitude:g}).")
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
            help="greedy: mirror images count as data too, as in fit-eigen. May be given twice.",
        ),
    ] = None,
    vehicle: VehicleOption = None,
    steps: Annotated[
        int | None,
        typer.Option(
            help=f"Steps of each trajectory (box: {BoxSample.steps}, point: {PointSample.steps}, "
            f"ellipsoid: {EllipsoidSample.steps}, greedy: {GreedySample.steps}, ball: {BallSample.steps})."
        ),
    ] = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw or lay out initial states and inputs.

    Kinds by kinetic energy (ellipsoid, greedy, ball) take mass and yaw inertia from the vehicle; greedy, which
    simulates as it goes, all of it; the others are of none.

    Example: koop sample ellipsoid --mesh fibonacci --shells 6
    """
    given: Values = {
        "kind": kind,
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
            help="Equations of motion: tyre forces as inputs, or tyres with slip and steer (what the sample is for).",
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
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Simulate trajectories of a vehicle from a sample.

    Example: koop simulate --vehicle my-car.toml
    """
    given: Values = {"plant": plant, "steps": steps, "dt": dt, "force_per": force_per}
    call = begin(store, experiment, set_, SIMULATE, {"simulate": given, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    of = call.named(sample, ["sample"], "the SAMPLE", ("simulate", "vehicle")) if sample else None
    call.run(recipes.simulation(call.experiment, of), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("sample", rich_help_panel="Make")(sample)
    app.command("simulate", rich_help_panel="Make")(simulate)
    fitting.register(app)
    evaluating.register(app)
