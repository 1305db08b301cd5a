"""The command that fits by extended dynamic mode decomposition."""

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
)
from koopcli.config.changes import Values
from koopcli.koopman.edmd.fit import FitEdmd


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

    of = [call.named(name, ["simulate", "import"], "the TRAJECTORIES", ("fit-edmd",)) for name in trajectories or []]
    call.run(lambda experiment: recipes.fit_edmd(experiment, *of), as_json=as_json, dry_run=dry_run)


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("fit-edmd")(fit_edmd)
