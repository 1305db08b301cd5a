"""The commands that make predictors: fit-edmd, fit-eigen, baseline."""

from __future__ import annotations

from typing import Annotated

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.derived import options_of
from koopcli.cli.invocation import DATA, begin
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
from koopcli.config.settings import BaselineKind
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen


@options_of(FitEdmd)
def fit_edmd(
    trajectories: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TRAJECTORIES",
            autocompletion=complete_name,
            help="Trajectories, or several of one plant to fit together; made from the settings when left out.",
        ),
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
    """Fit a Koopman predictor z⁺ = A z + B u, x̂ = C z by extended dynamic mode decomposition.

    With --terms bilinear it is z⁺ = A z + B u + Σ u_i N_i z: the products of an input with powers of the yaw rate,
    which no constant B can hold. The basis anisotropic has the powers it needs with few functions. With --terms
    generator the same data give ż = (K_0 + Σ u_i K_i) z, whose step also has what is quadratic in large inputs.

    Data of any size are read in blocks; what is summed over them is committed part by part, shared by --workers or a
    --cluster, and gone on with after an interruption.

    Example: koop fit-edmd --basis anisotropic --order 8 --terms bilinear
    """
    call = begin(
        store,
        experiment,
        set_,
        (*DATA, "fit-edmd"),
        {"fit-edmd": given, "vehicle": {"name": vehicle}},
        workers,
        cluster,
    )
    from koopcli.stages import recipes

    of = [call.named(name, ["simulate"], "the TRAJECTORIES", ("fit-edmd",)) for name in trajectories or []]
    call.run(lambda experiment: recipes.fit_edmd(experiment, *of), as_json=as_json, dry_run=dry_run)


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
    sample. Inputs have no effect on the prediction.

    That is the paper's predictor. The experiment best-eigen has the best one: initial states in the volume (kind
    greedy), a comb of rates, lifted states fitted to the horizon ahead, splines in world coordinates.

    Example: koop fit-eigen --experiment best-eigen --vehicle bmw-320i
    """
    call = begin(store, experiment, set_, (*DATA, "fit-eigen"), {"fit-eigen": given, "vehicle": {"name": vehicle}})
    from koopcli.stages import recipes

    of = call.optional(trajectories, ["simulate"], "the TRAJECTORIES", ("fit-eigen",))
    call.run(lambda experiment: recipes.fit_eigen(experiment, of), as_json=as_json, dry_run=dry_run)


def baseline(
    kind: Annotated[
        BaselineKind,
        typer.Argument(
            metavar=names(BaselineKind),
            help="hold: the first state; rotation: turned at its yaw rate; linearisation: of the plant at it.",
        ),
    ],
    trajectories: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="Trajectories whose plant it predicts; made when left out."),
    ] = None,
    vehicle: VehicleOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a baseline: a prediction without any fit, which a predictor has to beat.

    Example: koop evaluate "$(koop baseline rotation)"
    """
    call = begin(
        store, experiment, set_, (*DATA, "baseline"), {"baseline": {"kind": kind}, "vehicle": {"name": vehicle}}
    )
    from koopcli.stages import recipes

    of = call.optional(trajectories, ["simulate"], "the TRAJECTORIES", ("baseline",))
    call.run(lambda experiment: recipes.baseline(experiment, of), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("fit-edmd")(fit_edmd)
    app.command("fit-eigen")(fit_eigen)
    app.command("baseline")(baseline)
