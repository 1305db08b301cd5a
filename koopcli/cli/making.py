"""The commands that make data: sample, simulate."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.derived import options_of, ordered, said_of
from koopcli.cli.invocation import DATA, Invocation, begin
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
from koopcli.config.settings import Simulate
from koopcli.console import show_table
from koopcli.simulation.manoeuvres import ManoeuvreName
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample
from koopcli.simulation.samples.sample import SampleChoice

if TYPE_CHECKING:
    from koopcli.config.experiment import Experiment
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact

KINDS = ordered(SampleChoice, GridSample)


@options_of(*KINDS.values(), but=("name",))
def sample(
    kind: Annotated[
        Literal[tuple(KINDS)] | None,  # type: ignore[valid-type]
        typer.Argument(metavar="|".join(KINDS), help=f"{said_of(KINDS)} ({GridSample.kind})."),
    ] = None,
    name: Annotated[
        ManoeuvreName | None,
        typer.Argument(metavar=names(ManoeuvreName), help=f"manoeuvre: which one ({ManoeuvreSample.name})."),
    ] = None,
    *,
    given: Values,
    vehicle: VehicleOption = None,
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
    changes: Values = {"kind": kind, "name": name, **given}
    call = begin(store, experiment, set_, DATA, {"sample": changes, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    call.run(lambda experiment: recipes.sample(experiment.sample("grid")), as_json=as_json, dry_run=dry_run)


@options_of(Simulate)
def simulate(
    sample: Annotated[
        str | None, typer.Argument(autocompletion=complete_name, help="A sample; made from the settings when left out.")
    ] = None,
    *,
    given: Values,
    vehicle: VehicleOption = None,
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
    call = begin(store, experiment, set_, DATA, {"simulate": given, "vehicle": {"name": vehicle}}, workers, cluster)
    from koopcli.stages import recipes

    of = call.optional(sample, ["sample"], "the SAMPLE", ("simulate", "vehicle"))

    def simulation(experiment: Experiment) -> Task:
        return recipes.simulation(experiment, of)

    task = simulation(call.experiment)
    usual = [replace(task, settings=replace(task.settings, reference=False))] if task.settings.reference else []
    call.run(
        simulation,
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

    compared = call.pipeline.make(usual[0])
    differences = difference(compared.content, artefact.content)
    rows = [[name, unit, f"{largest:.3g}", f"{root:.3g}"] for name, unit, largest, root in differences]
    show_table(["usual − reference", "unit", "largest", "root mean square"], rows, left=2, file=sys.stderr)
    off = {name: {"max": largest, "rms": root, "unit": unit} for name, unit, largest, root in differences}
    return {"compared": compared.record.name, "difference": off}


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("sample")(sample)
    app.command("simulate")(simulate)
