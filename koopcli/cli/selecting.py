"""The command that chooses a predictor of a log and says whether it is worth having."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import begin
from koopcli.cli.options import DryRunOption, JsonOption, StoreOption, WorkersOption
from koopcli.cli.outputs import check_outputs, write_text
from koopcli.config.grids import parse_grid
from koopcli.console import show_table
from koopcli.errors import InvalidValueError, UsageError

if TYPE_CHECKING:
    from koopcli.koopman.selection.record import Selection
    from koopcli.stages.pipeline import Artefact

LADDER = {
    "fit-edmd.memory": "memory",
    "fit-edmd.terms": "products",
    "fit-edmd.order": "order",
    "fit-edmd.increment_ridge": "ridge",
}  # settings that several values of make a longer ladder
TERMS = {"linear": False, "products": True}


def select(
    data: Annotated[str, typer.Argument(autocompletion=complete_name, help="A log, as koop import names it.")],
    blocks: Annotated[int, typer.Option(metavar="N", help="Parts of the log, each of which is held out once.")] = 3,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="fit-edmd.KEY=VALUES",
            help="A longer ladder: fit-edmd.memory=0.2,0.4, fit-edmd.order=1,2, fit-edmd.increment_ridge=1e-5,1e-3, "
            "fit-edmd.terms=linear,products. Every combination is a rung.",
        ),
    ] = None,
    no_bicycle: Annotated[
        bool, typer.Option("--no-bicycle", help="Leave out the bicycle identified from the same rows: seconds.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.html", help="Write the verdict with its pictures.")
    ] = None,
    workers: WorkersOption = 1,
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Choose a predictor of a log and say whether it is worth having.

    Two predictors are compared: linear, and with products of inputs and states, both with 0.2 s of memory. Parts of the
    log are held out in turn; the choice is made without them, and they say how good it is, beside holding the state and
    beside DMD with control. The verdict is one sentence for each state, and says no where holding is better. The
    predictor is fitted to the whole log and named on stderr.

    Example: koop select import/3f2a --report verdict.html
    """
    check_outputs(report, None, as_json=as_json)
    call = begin(store, "paper", None, (), {}, workers)
    from koopcli.checks import build
    from koopcli.stages import measured
    from koopcli.stages.select import Select

    log = call.named(data, ["import"], "DATA", ())
    settings = build(Select, {**_ladder(set_ or []), "blocks": blocks, "bicycle": not no_bicycle})
    task = measured.selection(log, settings)

    def more(artefact: Artefact) -> dict[str, Any]:
        selection: Selection = artefact.content
        predictor = call.pipeline.make(measured.chosen(log, selection))
        if not as_json:
            _show(selection)
        if settings.bicycle and "bicycle" not in selection.models:
            call.console.note("no bicycle beside it: that needs the signals v_x, yaw_rate and steer")
        call.console.note(f"the predictor: {predictor.record.name}")
        if report is not None:
            from koopcli.reproduction.verdict import verdict_page

            score = measured.scored(measured.chosen(log, selection), log)
            write_text(report, verdict_page(call.pipeline, log, task, score))
            call.console.note(f"wrote {report}")
        return {"chosen": predictor.record.name}

    call.run(lambda experiment: task, as_json=as_json, dry_run=dry_run, extra=more)


def _ladder(assignments: Sequence[str]) -> dict[str, Any]:
    """The lists of a ladder from ``--set``."""
    grid = parse_grid(assignments)
    values = {axis.name: list(axis.values) for axis in grid.axes} | {name: [value] for name, value in grid.fixed}
    lists: dict[str, Any] = {}
    for name, given in values.items():
        if name not in LADDER:
            raise UsageError(f"--set {name} changes nothing here; a ladder has {', '.join(LADDER)}")
        if LADDER[name] == "products":
            for term in given:
                if term not in TERMS:
                    raise InvalidValueError(f"'fit-edmd.terms' must be one of {', '.join(TERMS)} here, got '{term}'")
        lists[LADDER[name]] = [TERMS[term] for term in given] if LADDER[name] == "products" else given
    return lists


def _show(selection: Selection) -> None:
    """Errors of every state, what was picked in which block, and the verdict, on stderr."""
    figures = selection.figures()
    units = dict(zip(selection.state_channels.names, selection.state_channels.units, strict=True))
    rows = [
        [
            name,
            units[name],
            f"{horizon} s",
            f"{about['rmse']:.3g}",
            f"{about['to_hold']:.2f}",
            f"{about['to_dmdc']:.2f}",
        ]
        for name, horizons in figures["per_state"].items()
        for horizon, about in horizons.items()
    ]
    show_table(["state", "unit", "ahead", "RMSE", "× hold", "× DMDc"], rows, left=2, file=sys.stderr)
    relative = np.exp(selection.scores - selection.scores[0])
    inner = [
        [rung.label, *("–" if np.isnan(ratio) else f"{ratio:.3f}" for ratio in ratios)]
        for rung, ratios in zip(selection.rungs, relative.tolist(), strict=True)
    ]
    header = ["error in each inner block", *(str(i + 1) for i in range(relative.shape[1]))]
    show_table(header, inner, left=1, file=sys.stderr)
    low, high = selection.span("chosen")
    blocks = [
        [str(i + 1), block["picked"], f"{block['ratio_to_dmdc']:.2f}"] for i, block in enumerate(figures["blocks"])
    ]
    show_table(["block held out", "picked without it", "× DMDc"], blocks, left=2, file=sys.stderr)
    span = zip(units, low[selection.judged[1]], high[selection.judged[1]], strict=True)
    print(
        "RMSE after 0.5 s over the blocks: " + ", ".join(f"{name} {a:.3g} to {b:.3g}" for name, a, b in span),
        file=sys.stderr,
    )
    outside, limited = 100 * figures["outside_share"], 100 * figures["limited_share"]
    print(
        f"{outside:.1f} % of the held-out rows lie outside the states of their training, {limited:.1f} % of the inputs "
        "are limited to theirs",
        file=sys.stderr,
    )
    print(figures["verdict"], file=sys.stderr)


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("select")(select)
