"""The commands that make artefacts: sample, simulate, fit-edmd, evaluate."""

from __future__ import annotations

from typing import Annotated

import typer

from koopcli.cli.options import (
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SeedOption,
    SetOption,
    StoreOption,
    VehicleOption,
)
from koopcli.cli.session import open_session
from koopcli.config.experiment import Values
from koopcli.config.settings import BasisName, Draw, Excitation, ForcePer, Kind, PlantName

TEST_SECTIONS = ("test", "evaluate")


def sample(
    kind: Annotated[Kind, typer.Argument(help="grid: the EDMD dataset; box: test states.")] = "grid",
    seed: SeedOption = None,
    count: Annotated[int | None, typer.Option(help="grid: values per state [15]; box: states [3375].")] = None,
    draw: Annotated[Draw | None, typer.Option(help="grid: how values are chosen. [random]")] = None,
    excitation: Annotated[Excitation | None, typer.Option(help="box: the inputs. [fresh]")] = None,
    amplitude: Annotated[float | None, typer.Option(help="box: inputs within ± amplitude, in N. [1e4]")] = None,
    steps: Annotated[int | None, typer.Option(help="box: steps of each trajectory. [30]")] = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw initial states and inputs.

    Example: koop sample grid --draw even
    """
    given: Values = {
        "kind": kind,
        "seed": seed,
        "count": count,
        "draw": draw,
        "excitation": excitation,
        "amplitude": amplitude,
        "steps": steps,
    }
    session = open_session(store, experiment, set_, {"sample": given})
    from koopcli.stages import recipes

    session.run(recipes.sample(session.experiment.sample), as_json=as_json, dry_run=dry_run)


def simulate(
    sample: Annotated[str | None, typer.Argument(help="A sample; made from the settings when left out.")] = None,
    plant: Annotated[PlantName | None, typer.Option(help="Equations of motion. [forces]")] = None,
    vehicle: VehicleOption = None,
    steps: Annotated[
        int | None, typer.Option(help="Steps of each trajectory. [as the sample says: 1 for a grid]")
    ] = None,
    dt: Annotated[float | None, typer.Option(help="Sampling period in s, one RK4 step. [0.01]")] = None,
    force_per: Annotated[ForcePer | None, typer.Option(help="What an input force acts on. [axle]")] = None,
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
    session = open_session(store, experiment, set_, {"simulate": given, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    of = session.named(sample, ["sample"], "the SAMPLE", ("simulate", "vehicle")) if sample else None
    session.run(recipes.simulation(session.experiment, of), as_json=as_json, dry_run=dry_run)


def fit_edmd(
    trajectories: Annotated[
        str | None, typer.Argument(help="Trajectories; made from the settings when left out.")
    ] = None,
    order: Annotated[int | None, typer.Option(help="Highest degree of each state. [7]")] = None,
    basis: Annotated[BasisName | None, typer.Option(help="Family of observables. [tensor]")] = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a Koopman predictor z⁺ = A z + B u, x̂ = C z by extended dynamic mode decomposition.

    Example: koop fit-edmd --order 7
    """
    session = open_session(store, experiment, set_, {"fit-edmd": {"order": order, "basis": basis}})
    from koopcli.stages import recipes

    of = session.named(trajectories, ["simulate"], "the TRAJECTORIES", ("fit-edmd",)) if trajectories else None
    session.run(recipes.fit_edmd(session.experiment, of), as_json=as_json, dry_run=dry_run)


def evaluate(
    predictor: Annotated[str | None, typer.Argument(help="A predictor; made from the settings when left out.")] = None,
    on: Annotated[str | None, typer.Option(metavar="TRAJECTORIES", help="Test on these trajectories.")] = None,
    excitation: Annotated[Excitation | None, typer.Option(help="Inputs of the test set. [fresh]")] = None,
    amplitude: Annotated[float | None, typer.Option(help="Test inputs within ± amplitude, in N. [1e4]")] = None,
    count: Annotated[int | None, typer.Option(help="Test trajectories. [3375]")] = None,
    steps: Annotated[int | None, typer.Option(help="Steps of each test trajectory. [30]")] = None,
    seed: SeedOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Score a predictor on test trajectories of its own vehicle: RMSE, re-lifted RMSE, largest errors.

    An interrupted evaluation goes on where it stopped.

    Example: koop evaluate fit-edmd/3f2a --excitation held
    """
    given: Values = {"excitation": excitation, "amplitude": amplitude, "count": count, "steps": steps, "seed": seed}
    session = open_session(store, experiment, set_, {"test": given})
    from koopcli.stages import recipes

    of = None
    if predictor:
        of = session.named(predictor, recipes.FITS, "the PREDICTOR", TEST_SECTIONS)
    elsewhere = [section for section in session.changes if section != "test"]
    test = session.named(on, ["simulate"], "--on", elsewhere) if on else None
    session.run(recipes.evaluation(session.experiment, of, test), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("sample", rich_help_panel="Make")(sample)
    app.command("simulate", rich_help_panel="Make")(simulate)
    app.command("fit-edmd", rich_help_panel="Make")(fit_edmd)
    app.command("evaluate", rich_help_panel="Make")(evaluate)
