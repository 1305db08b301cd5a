"""The command that compares two artefacts: diff."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import open_store, print_json
from koopcli.cli.options import JsonOption, StoreOption
from koopcli.console import Console, show_table
from koopcli.errors import DamagedArtefactError, InvalidValueError

if TYPE_CHECKING:
    from koopcli.records import Packed
    from koopcli.stages.compare import Comparison, Difference
    from koopcli.store import Record, Store

RTOL = 1e-9
LONG = 60  # characters of a value in a table
Pairs = dict[str, tuple[Any, Any]]  # name -> (in A, in B)


def diff(
    one: Annotated[
        str, typer.Argument(metavar="A", autocompletion=complete_name, help="An artefact by name, or an HDF5 file.")
    ],
    other: Annotated[str, typer.Argument(metavar="B", autocompletion=complete_name, help="The other one, likewise.")],
    rtol: Annotated[
        float,
        typer.Option(metavar="R", help=f"Values are equal where |a − b| ≤ R · max(|a|, |b|) ({RTOL:g})."),
    ] = RTOL,
    store: StoreOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare two artefacts: every setting behind them, their arrays, and the small facts beside those.

    The exit code is 0 whether they are equal or not; the last line says which, and "equal" in --json.

    Example: koop diff fit-edmd/3f2a fit-edmd/91bc --rtol 1e-6
    """
    from koopcli.stages.compare import compare

    if not (math.isfinite(rtol) and rtol >= 0):
        raise InvalidValueError(f"--rtol must be a finite number of at least 0, got {rtol:g}")
    console, shelf = open_store(store)
    (name_a, record_a, packed_a), (name_b, record_b, packed_b) = (_open(text, shelf, console) for text in (one, other))
    settings = _settings(record_a, record_b, shelf) if record_a is not None and record_b is not None else {}
    with console.progress("diff") as progress:
        comparison = compare(packed_a, packed_b, rtol, progress)
    if as_json:
        print_json(
            {
                "a": name_a,
                "b": name_b,
                "rtol": rtol,
                "equal": comparison.equal,
                "settings": {name: list(pair) for name, pair in settings.items()},
                "arrays": {array.name: _described(array) for array in comparison.arrays},
                "facts": {name: list(pair) for name, pair in comparison.facts.items()},
            }
        )
        return
    _show(name_a, name_b, settings, comparison)
    print(f"equal within {rtol:g}" if comparison.equal else f"different: {_what(comparison)}")


def _open(text: str, shelf: Store, console: Console) -> tuple[str, Record | None, Packed]:
    """What is called ``text``: its name, its record where it is an artefact, and its content."""
    from koopcli.stages.pipeline import Pipeline
    from koopcli.store.image import read_foreign

    if text.endswith(".h5") or _is_file(text):
        return text, None, read_foreign(Path(text))
    record = shelf.find(text)
    try:
        return record.name, record, shelf.read(record)
    except DamagedArtefactError as error:
        console.warn(f"{error}; making it again")
        pipeline = Pipeline(shelf, console)
        record = pipeline.make(pipeline.named(f"{record.stage}/{record.key}")).record
        return record.name, record, shelf.read(record)


def _is_file(text: str) -> bool:
    """Whether ``text`` is the path of a file, or of something that cannot be looked at: reading it says why."""
    from koopcli.paths import is_file

    try:
        return is_file(Path(text))
    except OSError:
        return True


def _settings(a: Record, b: Record, shelf: Store) -> Pairs:
    """The settings in which two artefacts or what they were made from differ, by role, stage and name."""
    from koopcli.stages.compare import differing
    from koopcli.stages.lineage import lineage
    from koopcli.stages.recorded import all_settings

    behind_a, behind_b = (dict(lineage(record, shelf).behind()) for record in (a, b))
    pairs: Pairs = {}
    for role in dict.fromkeys([*behind_a, *behind_b]):
        x, y = behind_a.get(role), behind_b.get(role)
        before = f"{role}: " if role else ""
        if x is None or y is None or x.stage != y.stage:
            pairs[f"{before}stage"] = (x.stage if x else None, y.stage if y else None)
            continue
        first, second = ({**all_settings(record), "version": record.recipe["version"]} for record in (x, y))
        pairs |= {f"{before}{x.stage}.{name}": pair for name, pair in differing(first, second).items()}
    return pairs


def _described(array: Difference) -> dict[str, Any]:
    return {
        "equal": array.equal,
        "shape": list(array.shape),
        "layout": list(array.layout),
        "max_abs": array.largest,
        "max_rel": array.relative,
        "beyond": array.beyond,
        "count": array.count,
    }


def _show(name_a: str, name_b: str, settings: Pairs, comparison: Comparison) -> None:
    for title, pairs in (("settings", settings), ("facts", comparison.facts)):
        if pairs:
            rows = [[name, _short(a), _short(b)] for name, (a, b) in pairs.items()]
            show_table([f"{title} that differ", f"A: {name_a}", f"B: {name_b}"], rows, left=3)
    rows = [
        [
            array.name,
            " × ".join(map(str, array.shape)),
            "equal" if array.equal else "; ".join(array.layout) or "values differ",
            *("" if value is None else f"{value:.3g}" for value in (array.largest, array.relative)),
            f"{array.beyond:,}",
        ]
        for array in comparison.arrays
    ]
    show_table(["array", "shape", "A | B", "largest |a − b|", "relative", "values beyond R"], rows, left=3)


def _what(comparison: Comparison) -> str:
    unequal = sum(not array.equal for array in comparison.arrays)
    return f"{unequal} of {len(comparison.arrays)} arrays, {len(comparison.facts)} facts"


def _short(value: object) -> str:
    text = "—" if value is None else str(value)
    return text if len(text) <= LONG else f"{text[: LONG - 1]}…"


def register(app: typer.Typer) -> None:
    """Add the commands of this file."""
    app.command("diff")(diff)
