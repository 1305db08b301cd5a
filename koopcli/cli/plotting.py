"""The command that draws."""

from __future__ import annotations

import os
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from koopcli.checks import candidates
from koopcli.cli.invocation import begin, print_json, write_csv
from koopcli.cli.options import DryRunOption, ExperimentOption, JsonOption, SetOption, StoreOption, complete_name
from koopcli.config.changes import SECTIONS, flat
from koopcli.config.pictures import FigureName, ImageFormat
from koopcli.console import show_table
from koopcli.errors import InvalidValueError, StorageError, UnknownNameError, UsageError

if TYPE_CHECKING:
    from koopcli.figures.registry import FigureKind
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact


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
    csv_: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write the numbers that are drawn, as a table.")
    ] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="What an artefact is called beside others: one for each, in their order."),
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
    if output is not None and csv_ is not None and output.resolve() == csv_.resolve():
        raise UsageError(f"{output} cannot be both the image and its numbers: name two files")
    for path in (output, csv_):
        if path is not None and (path.is_dir() or not os.access(path if _in_place(path) else path.parent, os.W_OK)):
            raise StorageError(f"cannot write {path}: name a file in a folder that can be written to")
    call = begin(store, experiment, set_, SECTIONS)
    from koopcli.figures.registry import FIGURES
    from koopcli.stages import drawn

    kind, made = FIGURES[figure], drawn.MADE[FIGURES[figure].made]
    if artefacts and kind.takes == "nothing":
        raise UsageError(f"the figure '{figure}' draws no artefact: leave out {' '.join(artefacts)}")
    if artefacts:
        told = drawn.TOLD_BESIDE if kind.takes == "predictor" else ("plot",) if kind.told else ()
        sources = [call.named(one, drawn.TAKES[kind.takes], f"what '{figure}' draws", told) for one in artefacts]
    else:
        for name, _ in flat(call.changes):
            if f"{name}.".startswith(made.fixed):
                raise UsageError(f"--set {name} changes nothing in the figure '{figure}': {made.instead}")
        sources = made.tasks(call.experiment)
    labels = _labels(label, sources, kind)

    def export(artefact: Artefact) -> None:
        if output is not None:
            _write(output, artefact.content.image)
            call.console.note(f"wrote {output}")
        if csv_ is not None:
            text = StringIO()
            write_csv(artefact.content, text)
            _write(csv_, text.getvalue().encode())
            call.console.note(f"wrote {csv_}")
        if output is None and csv_ is None and not as_json:
            call.console.note("add -o FILE.png, .svg or .pdf to write the image, --csv FILE for its numbers")

    task = drawn.figure(figure, sources, image, call.experiment, call.simulated, labels)
    told_by = [f"plot.{name}" for name in kind.told]
    call.run(task, as_json=as_json, dry_run=dry_run, extra=export, reads=(*made.reads, *told_by))


def _labels(given: list[str] | None, sources: list[Task], kind: FigureKind) -> dict[Task, str] | None:
    """What every artefact is called, if that was told."""
    if not given:
        return None
    if kind.draws != "beside":
        raise UsageError("--label changes nothing here: it names artefacts that a figure sets beside one another")
    if len(given) != len(sources):
        raise UsageError(f"--label is given {len(given)} times for {len(sources)} artefacts: give one for each")
    return dict(zip(sources, given, strict=True))


def _format(output: Path | None) -> ImageFormat:
    if output is None:
        return "png"
    ending = output.suffix.lower().lstrip(".")
    for known in get_args(ImageFormat):
        if ending == known:
            return known  # type: ignore[no-any-return]
    raise InvalidValueError(f"{output}: unknown ending; write to a file ending in .{', .'.join(get_args(ImageFormat))}")


def _in_place(path: Path) -> bool:
    """Whether ``path`` must be written where it is: a device, a pipe, or a link that stays one."""
    return path.exists() and (path.is_symlink() or not path.is_file())


def _write(path: Path, content: bytes) -> None:
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        if _in_place(path):
            path.write_bytes(content)
            return
        beside.write_bytes(content)
        os.replace(beside, path)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}") from error
    finally:
        beside.unlink(missing_ok=True)


def _list(*, as_json: bool) -> None:
    from koopcli.figures.registry import FIGURES

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
    app.command("plot", rich_help_panel="Make")(plot)
