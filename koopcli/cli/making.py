"""The commands that make artefacts: sample, simulate, fit-edmd, evaluate."""

from __future__ import annotations

from typing import Annotated

import typer

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
from koopcli.config.experiment import Changes, Values
from koopcli.config.settings import (
    BasisName,
    BoxSample,
    Draw,
    Excitation,
    FitEdmd,
    ForcePer,
    GridSample,
    Kind,
    PlantName,
    Simulate,
)

SAMPLE = ("sample",)
SIMULATE = (*SAMPLE, "vehicle", "simulate")
FIT_EDMD = (*SIMULATE, "fit-edmd")
TEST = ("test", "evaluate")


def sample(
    kind: Annotated[
        Kind | None,
        typer.Argument(metavar=names(Kind), help="grid: the EDMD dataset (the default); box: test states."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help=f"Seed of every draw (grid: {GridSample.seed}, box: {BoxSample.seed}).")
    ] = None,
    count: Annotated[
        int | None, typer.Option(help=f"grid: values per state ({GridSample.count}); box: states ({BoxSample.count}).")
    ] = None,
    draw: Annotated[
        Draw | None, typer.Option(metavar=names(Draw), help=f"grid: how values are chosen ({GridSample.draw}).")
    ] = None,
    excitation: Annotated[
        Excitation | None, typer.Option(metavar=names(Excitation), help=f"box: the inputs ({BoxSample.excitation}).")
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help=f"box: inputs within ± amplitude, in N ({BoxSample.amplitude:g}).")
    ] = None,
    steps: Annotated[int | None, typer.Option(help=f"box: steps of each trajectory ({BoxSample.steps}).")] = None,
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
    call = begin(store, experiment, set_, SAMPLE, {"sample": given})
    from koopcli.stages import recipes

    call.run(recipes.sample(call.experiment.sample), as_json=as_json, dry_run=dry_run)


def simulate(
    sample: Annotated[
        str | None, typer.Argument(autocompletion=complete_name, help="A sample; made from the settings when left out.")
    ] = None,
    plant: Annotated[
        PlantName | None, typer.Option(metavar=names(PlantName), help=f"Equations of motion ({Simulate.plant}).")
    ] = None,
    vehicle: VehicleOption = None,
    steps: Annotated[
        int | None, typer.Option(help="Steps of each trajectory (as the sample says; 1 for a grid).")
    ] = None,
    dt: Annotated[float | None, typer.Option(help=f"Sampling period in s, one RK4 step ({Simulate.dt}).")] = None,
    force_per: Annotated[
        ForcePer | None,
        typer.Option(metavar=names(ForcePer), help=f"What an input force acts on ({Simulate.force_per})."),
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


def fit_edmd(
    trajectories: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="Trajectories; made from the settings when left out."),
    ] = None,
    order: Annotated[int | None, typer.Option(help=f"Highest degree of each state ({FitEdmd.order}).")] = None,
    vehicle: VehicleOption = None,
    basis: Annotated[
        BasisName | None, typer.Option(metavar=names(BasisName), help=f"Family of observables ({FitEdmd.basis}).")
    ] = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fit a Koopman predictor z⁺ = A z + B u, x̂ = C z by extended dynamic mode decomposition.

    Example: koop fit-edmd --order 7
    """
    given: Changes = {"fit-edmd": {"order": order, "basis": basis}, "vehicle": {"name": vehicle}}
    call = begin(store, experiment, set_, FIT_EDMD, given)
    from koopcli.stages import recipes

    of = call.named(trajectories, ["simulate"], "the TRAJECTORIES", ("fit-edmd",)) if trajectories else None
    call.run(recipes.fit_edmd(call.experiment, of), as_json=as_json, dry_run=dry_run)


def evaluate(
    predictor: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="A predictor; made from the settings when left out."),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(autocompletion=complete_name, metavar="TRAJECTORIES", help="Test on these trajectories."),
    ] = None,
    excitation: Annotated[
        Excitation | None,
        typer.Option(metavar=names(Excitation), help=f"Inputs of the test set ({BoxSample.excitation})."),
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help=f"Test inputs within ± amplitude, in N ({BoxSample.amplitude:g}).")
    ] = None,
    count: Annotated[int | None, typer.Option(help=f"Test trajectories ({BoxSample.count}).")] = None,
    steps: Annotated[int | None, typer.Option(help=f"Steps of each test trajectory ({BoxSample.steps}).")] = None,
    seed: Annotated[int | None, typer.Option(help=f"Seed of the test set ({BoxSample.seed}).")] = None,
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
    call = begin(store, experiment, set_, (*FIT_EDMD, *TEST), {"test": given})
    from koopcli.stages import recipes

    of = None
    if predictor:
        of = call.named(predictor, recipes.FITS, "the PREDICTOR", TEST)
    elsewhere = [section for section in call.changes if section != "test"]
    test = call.named(on, ["simulate"], "--on", elsewhere) if on else None
    if of is not None and test is None and of.find("simulate") is None:
        plant = recipes.remembered_plant(call.pipeline.make(of).content)
        test = recipes.test_set(call.experiment, plant)
    call.run(recipes.evaluation(call.experiment, of, test), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("sample", rich_help_panel="Make")(sample)
    app.command("simulate", rich_help_panel="Make")(simulate)
    app.command("fit-edmd", rich_help_panel="Make")(fit_edmd)
    app.command("evaluate", rich_help_panel="Make")(evaluate)
