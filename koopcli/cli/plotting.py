"""The command that draws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from koopcli.checks import candidates
from koopcli.cli.completion import complete_figure, complete_name
from koopcli.cli.invocation import begin, print_json
from koopcli.cli.options import DryRunOption, ExperimentOption, JsonOption, SetOption, StoreOption
from koopcli.cli.outputs import STDOUT, CsvOption, OutputOption, check_outputs, image_format, write_outputs
from koopcli.config.changes import SECTIONS
from koopcli.console import show_table
from koopcli.errors import UnknownNameError, UsageError
from koopcli.figures import NAMES

if TYPE_CHECKING:
    from koopcli.config.experiment import Experiment
    from koopcli.figures.kit.figure import FigureKind
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact


def plot(
    figure: Annotated[
        str | None, typer.Argument(autocompletion=complete_figure, help="Name of the figure; --list shows them all.")
    ] = None,
    artefacts: Annotated[
        list[str] | None,
        typer.Argument(autocompletion=complete_name, metavar="ARTEFACT", help="Artefacts to draw; made when left out."),
    ] = None,
    output: OutputOption = None,
    csv_: CsvOption = None,
    label: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="Label of an artefact beside others: one for each, in their order."),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List the figures.")] = False,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw a figure of artefacts, making them when they are not named.

    A figure that can be drawn for either fit makes the one that the experiment is about.

    Example: koop plot error-map -o errors.pdf
    """
    if list_:
        _list(as_json=as_json)
        return
    if figure is None:
        raise UsageError(f"which figure? Name one of: {', '.join(NAMES)}")
    if figure not in NAMES:
        raise UnknownNameError(f"unknown figure '{figure}'{candidates(figure, NAMES)}")
    image = image_format(output)
    check_outputs(output, csv_, as_json=as_json)
    call = begin(store, experiment, set_, SECTIONS)
    from koopcli.figures.kit.registry import FIGURES
    from koopcli.stages import figure_tasks

    kind = FIGURES[figure]
    if artefacts and kind.takes == "nothing":
        raise UsageError(f"the figure '{figure}' draws no artefact: leave out {' '.join(artefacts)}")
    told = figure_tasks.TOLD_BESIDE if kind.takes == "predictor" else ("plot",) if kind.told else ()
    named = [call.named(name, kind.stages, f"what '{figure}' draws", told) for name in artefacts or []]
    labels = _labels(label, named or figure_tasks.artefacts(figure, call.experiment), kind)

    def export(artefact: Artefact) -> None:
        write_outputs(call.console, artefact.content.image, output, artefact.content, csv_)
        if output is None and csv_ is None and not as_json:
            call.console.note("add -o FILE.png, .svg or .pdf to write the image, --csv FILE for its numbers")

    def drawn(experiment: Experiment) -> Task:
        sources = named or figure_tasks.artefacts(figure, experiment)
        return figure_tasks.figure(figure, sources, image, experiment, call.simulated, labels)

    call.run(drawn, as_json=as_json, dry_run=dry_run, extra=export, table_out=csv_ == STDOUT)


def _labels(given: list[str] | None, sources: list[Task], kind: FigureKind) -> dict[Task, str] | None:
    """What every artefact is called, if that was told."""
    if not given:
        return None
    if kind.draws != "beside":
        raise UsageError("--label changes nothing here: it names artefacts that a figure sets beside one another")
    if len(given) != len(sources):
        raise UsageError(f"--label is given {len(given)} times for {len(sources)} artefacts: give one for each")
    return dict(zip(sources, given, strict=True))


def _list(*, as_json: bool) -> None:
    from koopcli.figures.kit.registry import FIGURES

    if as_json:
        print_json({name: {"shows": kind.about, "takes": kind.takes} for name, kind in FIGURES.items()})
        return
    rows = [[name, kind.about, _takes(kind)] for name, kind in FIGURES.items()]
    show_table(["figure", "shows", "of"], rows, left=3)


def _takes(kind: FigureKind) -> str:
    """The artefacts that a figure takes, in words."""
    if kind.takes == "nothing":
        return "–"
    what = f"{kind.takes} of kind {' or '.join(kind.kinds)}" if kind.kinds else kind.takes
    return what if kind.draws == "one" else f"{what}s"


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("plot")(plot)
