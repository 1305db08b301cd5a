"""The application: its commands in the order in which they are used."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

import typer

import koopcli
from koopcli.cli.lazy import Entry, group_of

REPRODUCE, OWN, MAKE, LOOK = "Reproduce", "Your own log", "Make", "Look into the store and after it"
COMMANDS = (
    Entry(
        "reproduce",
        "reproduce",
        REPRODUCE,
        "Reproduce the paper at full size and put its numbers beside those found here: EDMD over orders, training "
        "grids and test inputs; eigenfunctions over readings of the text, two tyres, cuts, grip and baselines.",
    ),
    Entry("import", "importing", OWN, "Bring in a log of your own car, with checks of its units, signs and clocks."),
    Entry("select", "selecting", OWN, "Choose a predictor of a log and say whether it is worth having."),
    Entry("predict", "predicting", OWN, "Predict from a state of a log, or from one that is given."),
    Entry("control", "controlling", MAKE, "Drive a scenario in a closed loop: recover from a spin, change lanes."),
    Entry("sample", "making", MAKE, "Draw or lay out initial states and inputs."),
    Entry("simulate", "making", MAKE, "Simulate trajectories of a vehicle from a sample."),
    Entry(
        "fit-edmd",
        "fit_edmd",
        MAKE,
        "Fit a Koopman predictor z⁺ = A z + B u, x̂ = C z by extended dynamic mode decomposition.",
    ),
    Entry(
        "fit-eigen",
        "fit_eigen",
        MAKE,
        "Fit a Koopman predictor whose lifted states are eigenfunctions, built from trajectories without inputs.",
    ),
    Entry(
        "baseline", "baseline", MAKE, "Make a baseline: a prediction without any fit, which a predictor has to beat."
    ),
    Entry(
        "evaluate",
        "evaluating",
        MAKE,
        "Score a predictor on test trajectories of its own plant and vehicle: RMSE, re-lifted RMSE, largest errors.",
    ),
    Entry("sweep", "sweeping", MAKE, "Fit and score a predictor for every combination of some settings."),
    Entry("plot", "plotting", MAKE, "Draw a figure of artefacts, making them when they are not named."),
    Entry("ls", "looking", LOOK, "List the artefacts of the store, oldest first."),
    Entry(
        "show",
        "looking",
        LOOK,
        "Show an artefact: its numbers, every setting behind it, its arrays, and how it was made.",
    ),
    Entry("path", "looking", LOOK, "Print where the HDF5 file of an artefact lies, after verifying it."),
    Entry(
        "diff",
        "comparing",
        LOOK,
        "Compare two artefacts: every setting behind them, their arrays, and the small facts beside those.",
    ),
    Entry("pin", "looking", LOOK, "Mark an artefact to be kept."),
    Entry("unpin", "looking", LOOK, "Take back a pin, of one artefact or of a reproduction."),
    Entry(
        "verify",
        "keeping",
        LOOK,
        "Check the artefacts of the store for damage. Without --repair nothing is changed.",
    ),
    Entry(
        "gc",
        "keeping",
        LOOK,
        "Remove artefacts that nobody keeps: neither pinned, nor young, nor behind any such artefact.",
    ),
    Entry("vehicle", "vehicles", LOOK, "Look into vehicle files: their parameters and what follows from them."),
)

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
    cls=group_of(COMMANDS),
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help=f"Identify Koopman predictors of vehicle dynamics. To begin with:\n\n\b\n{LINES}\n\n"
    "Your own vehicle is a file, --vehicle ./my-car.toml. Run any command by itself: it makes whatever is missing, "
    "keeps everything in a store and reuses it. Defaults stand in parentheses. They are the paper's; an --experiment "
    "file or --set changes any of them.",
)


@cache
def root() -> Any:
    """The command ``koop``, built once a process, whose commands are imported when they are called."""
    return typer.main.get_command(app)


def whole() -> dict[str, Any]:
    """All commands by name, imported."""
    return {entry.name: root().load(entry.name) for entry in COMMANDS}


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
