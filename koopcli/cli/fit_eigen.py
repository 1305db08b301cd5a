"""The command that fits eigenfunctions."""

from __future__ import annotations

from typing import Annotated

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.derived import options_of
from koopcli.cli.invocation import DATA, begin
from koopcli.cli.options import (
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
)
from koopcli.config.changes import Values
from koopcli.koopman.eigen.fit import FitEigen


@options_of(FitEigen)
def fit_eigen(
    trajectories: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="Trajectories; made from the settings when left out."),
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
    """Fit a Koopman predictor whose lifted states are eigenfunctions, built from trajectories without inputs.

    The trajectories start on a surface Γ of one kinetic energy (kind ellipsoid) and never return to it. Along each of
    them an eigenfunction grows as exp(rate · time) from its value on Γ; a new state takes the values of the nearest
    sample. Inputs have no effect on the prediction, but for changes of axle forces, with --inputs forces: these act
    through the derivative of the lift, and nothing is fitted to them.

    That is the paper's predictor. The experiment best-eigen has the best one: initial states in the volume (kind
    greedy), a comb of rates, lifted states fitted to the horizon ahead, splines in world coordinates, looked up a
    twentieth of a second at a time. Each lift then takes ten lookups. That of the experiment quick-eigen takes one, in
    a tenth of the time, with four to seven times the error.

    Example: koop fit-eigen --experiment best-eigen --vehicle bmw-320i
    """
    call = begin(store, experiment, set_, (*DATA, "fit-eigen"), {"fit-eigen": given, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    of = call.optional(trajectories, ["simulate"], "the TRAJECTORIES", ("fit-eigen",))
    call.run(lambda experiment: recipes.fit_eigen(experiment, of), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("fit-eigen")(fit_eigen)
