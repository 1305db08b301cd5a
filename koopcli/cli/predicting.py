"""The command that predicts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import begin
from koopcli.cli.options import DryRunOption, JsonOption, StoreOption
from koopcli.cli.outputs import STDOUT, CsvOption, check_outputs, write_outputs
from koopcli.errors import InvalidValueError, UsageError

if TYPE_CHECKING:
    from koopcli.stages.pipeline import Artefact


def predict(
    predictor: Annotated[str, typer.Argument(autocompletion=complete_name, help="A predictor.")],
    from_: Annotated[
        str | None,
        typer.Option("--from", autocompletion=complete_name, metavar="LOG", help="Start in this log, with its inputs."),
    ] = None,
    at: Annotated[
        float | None, typer.Option(metavar="S", help="Where to start, in s after the first row of the recording.")
    ] = None,
    run: Annotated[int, typer.Option(metavar="N", help="Recording of the log, counted from 0.")] = 0,
    x0: Annotated[
        str | None, typer.Option(metavar="X,Y,…", help="Start from this state instead, in SI, one number a state.")
    ] = None,
    inputs: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Inputs: a column for each by its name, with its unit in brackets unless that is SI; a row a step.",
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(metavar="S", help="How far to predict (1 s, or as the inputs).")
    ] = None,
    csv_: CsvOption = None,
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Predict from a state of a log, or from one that is given.

    From a log the prediction has the history that it starts from, the inputs that were measured, and the measured
    states beside it, and --csv writes the table in the units of the map. From --x0 alone it is as if the car had stood
    so for as long as the predictor remembers; its table is in SI.

    Example: koop predict fit-edmd/3f2a --from import/51c0 --at 12.3 --csv -
    """
    check_outputs(None, csv_, as_json=as_json)
    call = begin(store, "paper", None, (), {})
    from koopcli.checks import build
    from koopcli.stages import fits, measured
    from koopcli.stages.predict import Predict

    log = call.optional(from_, ["import"], "--from", ())
    of = call.named(predictor, tuple(fits.LIFTED), "the PREDICTOR", ())
    if (log is None) == (x0 is None):
        what = "say where to start" if x0 is None else "--from and --x0 are two starts, choose one"
        raise UsageError(f"{what}: --from LOG --at S, or --x0 X,Y,…")
    if log is not None and (at is None or inputs is not None):
        raise UsageError("--from LOG goes with --at S, and takes the inputs of the log, not --inputs")
    values: dict[str, Any] = {"run": run}
    if x0 is None:
        values["at"] = at
    else:
        values["x0"] = _numbers(x0)
    if inputs is not None:
        content = call.pipeline.make(of).content
        rows = _rows(inputs, content.input_channels.names)
        values |= {"u": rows, "seconds": len(rows) * content.dt}
    if seconds is not None:
        values["seconds"] = seconds
    task = measured.prediction(of, build(Predict, values), log)

    def export(artefact: Artefact) -> None:
        write_outputs(call.console, b"", None, artefact.content, csv_)

    call.run(lambda experiment: task, as_json=as_json, dry_run=dry_run, extra=export, table_out=csv_ == STDOUT)


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InvalidValueError(
            f"--x0 {text}: numbers with commas between them were expected, such as 20,0.1,0"
        ) from error


def _rows(path: Path, names: tuple[str, ...]) -> list[list[float]]:
    """The inputs in a CSV file in SI, in the order of ``names``."""
    from koopcli.logs.units import unit

    try:
        with path.open(encoding="utf-8") as file:
            titles = [title.partition("(") for title in file.readline().split(",")]
            values = np.loadtxt(file, delimiter=",", ndmin=2)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise InvalidValueError(f"--inputs {path}: {error}") from error
    header = [name.strip() for name, _, _ in titles]
    factors = [unit(text.strip().rstrip(")"), f"--inputs {path}").factor if text else 1.0 for _, _, text in titles]
    missing = [name for name in names if name not in header]
    if missing or values.shape[1:] != (len(header),) or not len(values):
        raise InvalidValueError(
            f"--inputs {path} must have a header with {', '.join(names)} and a row for each step, got the columns "
            f"{', '.join(header)} and {len(values)} rows"
        )
    return [[float(row[header.index(name)] * factors[header.index(name)]) for name in names] for row in values]


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("predict")(predict)
