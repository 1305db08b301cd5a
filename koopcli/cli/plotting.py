"""The command that draws."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from koopcli.checks import candidates
from koopcli.cli.invocation import begin, print_json
from koopcli.cli.options import DryRunOption, ExperimentOption, JsonOption, SetOption, StoreOption, complete_name
from koopcli.config.experiment import SECTIONS, flat
from koopcli.config.settings import FigureName, ImageFormat
from koopcli.console import show_table
from koopcli.errors import InvalidValueError, StorageError, UnknownNameError, UsageError

if TYPE_CHECKING:
    from koopcli.stages.pipeline import Artefact

SWEPT = ("fit-edmd.order", "reproduce.draws", "reproduce.excitations")  # by a figure of several evaluations
UNREAD = {"edmd": ("fit-eigen", "baseline"), "eigen": ("fit-edmd", "baseline", "reproduce")}  # sections, by method
INSTEAD = "it sweeps reproduce.orders with sample.draw and test.excitation"


def plot(
    figure: Annotated[str | None, typer.Argument(help="Name of the figure; --list shows them.")] = None,
    artefacts: Annotated[
        list[str] | None,
        typer.Argument(autocompletion=complete_name, metavar="ARTEFACT", help="What to draw; made when left out."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Write the image: .png, .svg or .pdf."),
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="List the figures.")] = False,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw a figure from artefacts, making them when they are not named.

    Example: koop plot error-map -o errors.pdf
    """
    if list_:
        _list(as_json=as_json)
        return
    if figure is None:
        raise UsageError(f"which figure? Name one of: {', '.join(get_args(FigureName))}")
    if figure not in get_args(FigureName):
        raise UnknownNameError(f"unknown figure '{figure}'{candidates(figure, get_args(FigureName))}")
    image = _format(output)
    if output is not None and (output.is_dir() or not os.access(output.parent, os.W_OK)):
        raise StorageError(f"cannot write {output}: name a file in a folder that can be written to")
    call = begin(store, experiment, set_, SECTIONS)
    from koopcli.figures.registry import FIGURES
    from koopcli.stages import recipes

    if artefacts:
        evaluations = [call.named(name, ["evaluate"], f"what '{figure}' draws", ()) for name in artefacts]
    else:
        for name, _ in flat(call.changes):
            if FIGURES[figure].several and name in SWEPT:
                raise UsageError(f"--set {name} changes nothing in the figure '{figure}': {INSTEAD}")
            if name.partition(".")[0] in UNREAD[FIGURES[figure].method]:
                raise UsageError(f"--set {name} changes nothing in the figure '{figure}'")
        evaluations = recipes.drawn_by_default(figure, call.experiment)

    def export(artefact: Artefact) -> None:
        if output is not None:
            _write(output, artefact.content.image)
            call.console.note(f"wrote {output}")
        elif not as_json:
            call.console.note("add -o FILE.png, .svg or .pdf to write the image")

    task = recipes.figure(figure, evaluations, image)
    call.run(task, as_json=as_json, dry_run=dry_run, extra=export)


def _format(output: Path | None) -> ImageFormat:
    if output is None:
        return "png"
    ending = output.suffix.lower().lstrip(".")
    for known in get_args(ImageFormat):
        if ending == known:
            return known  # type: ignore[no-any-return]
    raise InvalidValueError(f"{output}: unknown ending; write to a file ending in .{', .'.join(get_args(ImageFormat))}")


def _write(path: Path, content: bytes) -> None:
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_bytes(content)
        os.replace(beside, path)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error
    finally:
        beside.unlink(missing_ok=True)


def _list(*, as_json: bool) -> None:
    from koopcli.figures.registry import FIGURES

    if as_json:
        print_json({name: kind.about for name, kind in FIGURES.items()})
        return
    show_table(["figure", "shows"], [[name, kind.about] for name, kind in FIGURES.items()], left=2)


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("plot", rich_help_panel="Make")(plot)
