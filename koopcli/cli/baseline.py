"""The command that makes a baseline."""

from __future__ import annotations

from typing import Annotated

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import DATA, begin
from koopcli.cli.options import (
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
    names,
)
from koopcli.config.settings import BaselineKind


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
    """Add the command of this file."""
    app.command("baseline")(baseline)
