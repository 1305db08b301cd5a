"""The application: its commands in the order in which they are used."""

from __future__ import annotations

from typing import Annotated

import typer

import koopcli
from koopcli.cli import command, comparing, keeping, looking, making, plotting, reproduce, sweeping, vehicles

app = typer.Typer(
    name="koop",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Identify Koopman predictors of vehicle dynamics.\n\nEvery command makes or reads artefacts in a store; "
    "a command named alone makes what it needs and reuses what is there. Defaults stand in parentheses; they are "
    "the paper's, and an --experiment file or --set changes any of them.\n\n"
    "Example: koop fit-edmd --order 7 && koop evaluate",
)
reproduce.register(app)
making.register(app)
sweeping.register(app)
plotting.register(app)
looking.register(app)
comparing.register(app)
keeping.register(app)
vehicles.register(app)
command.prepare(app)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"koop {koopcli.__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass
