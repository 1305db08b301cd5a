"""The application: its commands in the order in which they are used."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

import typer

import koopcli
from koopcli.cli import command, comparing, keeping, looking, making, plotting, reproduce, sweeping, vehicles

FIRST = (
    ("koop reproduce", "the paper's results"),
    ("koop evaluate --experiment best-edmd", "a good predictor"),
    ("koop evaluate --experiment best-edmd --vehicle bmw-320i", "another vehicle"),
    ("koop sweep --set fit-edmd.order=1:8", "many predictors"),
    ("koop ls", "what there is"),
)  # what to type first, and what it gives
LINES = "\n".join(f"{command:<57}{gives}" for command, gives in FIRST)

app = typer.Typer(
    name="koop",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help=f"Identify Koopman predictors of vehicle dynamics. To begin with:\n\n\b\n{LINES}\n\n"
    "Your own vehicle is a file, --vehicle ./my-car.toml. Run any command by itself: it makes whatever is missing, "
    "keeps everything in a store and reuses it. Defaults stand in parentheses. They are the paper's; an --experiment "
    "file or --set changes any of them.",
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


@cache
def root() -> Any:
    """The command ``koop``, built once a process."""
    return typer.main.get_command(app)


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
