"""A first map for a log, from the names, units and magnitudes in its files, with what was guessed beside each line."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from koopcli.errors import InvalidValueError
from koopcli.logs.clockclues import numbers
from koopcli.logs.clues import Clue, FileClues
from koopcli.logs.entries import GAP
from koopcli.logs.quantities import LIMITS, QUANTITIES, words_of
from koopcli.logs.settle import settled
from koopcli.logs.sourceclues import sources_of
from koopcli.text import one_line

STEPS = (0.04, 0.05, 0.1, 0.2, 0.5, 1.0)  # s: a finer grid predicts no better
WHEELS_TURN = 1.0  # rad, the most that the wheels of a car turn
SHOWN = 12  # names in one comment
STANDING = 0.02  # share of rows; a car that stands obeys other equations
SMALL_TOP = 10.0  # m/s, which a small car does not reach
KEPT_ABOVE = (0.3, 1.0)  # m/s, for a small and for a large car
DRIVING = ("throttle", "brake", "torque", "v_command")
CORNERS = frozenset(("fl", "fr", "rl", "rr", "front", "rear", "left", "right", "f", "r", "1", "2", "3", "4"))
HAND_WHEEL = frozenset(("wheel", "swa", "handwheel", "sas", "hand", "sw"))
RATIO = 16  # of the steering of many cars


@dataclass(frozen=True)
class Suggestion:
    """A first map: its ``text`` in TOML, and ``notes``, a line each, on what was not found, left out or doubted."""

    text: str
    notes: tuple[str, ...]


def suggest(files: Sequence[Path]) -> Suggestion:
    """A first map for the log in ``files``, in which states, inputs and times are guessed.

    Files of one name in different folders, and files of equal columns, are taken for runs, of which the first is
    looked at. Raises ``InvalidValueError`` where none of the files can be read.
    """
    notes: list[str] = []
    sources = sources_of(files, notes)
    if not sources:
        raise InvalidValueError(
            f"no log in {len(files)} files: {notes[0] if notes else 'files with columns were expected'}"
        )
    states, inputs = _chosen(sources, notes)
    states = settled(states, sources, notes)
    used = [file for file in sources if file.source in {clue.source for clue in (*states, *_flat(inputs))}]
    for file in sources:
        if used and file not in used:
            notes.append(f"{file.ending} is not used: {_columns(file)}")
        notes += [f"{file.ending}: '{one_line(title)}' is constant and left out" for title in file.constant]
    lines = ["# A first map, guessed from names, units and magnitudes: check every line, then import with it."]
    for file in sources:
        lines += [f"# {file.ending} has {_columns(file)}", *_ranges(file)]
    lines += _log(used or sources, states, notes)
    for file in used or sources:
        lines += ["", *_source(file, notes)]
    lines += ["", "[states]", *_states(states, notes), "", "[inputs]", *_inputs(inputs, notes)]
    return Suggestion("\n".join(lines) + "\n", tuple(dict.fromkeys(notes)))


def _chosen(sources: Sequence[FileClues], notes: list[str]) -> tuple[list[Clue], list[list[Clue]]]:
    """The clues of states, and of inputs, for some of which several columns make one signal."""
    states: list[Clue] = []
    inputs: list[list[Clue]] = []
    for quantity in QUANTITIES:
        clues = [clue for file in sources for clue in file.clues if clue.quantity.name == quantity.name]
        if not clues or quantity.kind is None:
            continue
        order = quantity.synonyms
        clues.sort(key=lambda clue: (clue.beside, _rank(clue, order), len(clue.title)))
        best = clues[0]
        alike = [clue for clue in clues if _bare(clue) == _bare(best) and clue.source == best.source]
        chosen = alike if quantity.name in ("torque", "brake") and len(alike) > 1 else [best]
        if quantity.kind == "input":
            inputs.append(chosen)
        elif quantity.name != "side_slip" or "v_y" not in [clue.quantity.name for clue in states]:
            states.append(best)
        others = [f"'{one_line(clue.title)}' of {clue.source}" for clue in clues if clue not in chosen]
        if others:
            notes.append(f"{quantity.name} could also be {', '.join(others[:SHOWN])}")
    return states, inputs


def _rank(clue: Clue, order: Sequence[str]) -> int:
    name = clue.title.lower().replace(" ", "_")
    return order.index(name) if name in order else len(order)


def _bare(clue: Clue) -> tuple[str, ...]:
    """The words of a title without those of a corner of the car."""
    return tuple(word for word in words_of(clue.title) if word not in CORNERS)


def _flat(inputs: Sequence[Sequence[Clue]]) -> list[Clue]:
    return [clue for clues in inputs for clue in clues]


def _columns(file: FileClues) -> str:
    names = [one_line(name) for name in file.table.names if name]
    if not names:
        return f"{len(file.table.names)} columns without names"
    more = f" and {len(names) - 3 * SHOWN} more" if len(names) > 3 * SHOWN else ""
    return f"the columns {', '.join(names[: 3 * SHOWN])}{more}"


def _ranges(file: FileClues) -> Iterator[str]:
    """Comments on the range of each column, where no column has a name to know it by."""
    for place in range(len(file.table.names) if not any(file.table.names) else 0)[:SHOWN]:
        values = numbers(file.table, place)
        if values is not None:
            yield f"#   column {place} from {values.min():.6g} to {values.max():.6g}"


def _log(used: Sequence[FileClues], states: Sequence[Clue], notes: list[str]) -> Iterator[str]:
    steps = {file.source: file.clock.step for file in used if file.clock is not None and math.isfinite(file.clock.step)}
    slowest = max(steps.values(), default=STEPS[0])
    dt = next((step for step in STEPS if step >= 0.98 * slowest), STEPS[-1])
    rates = ", ".join(f"{source} {1 / step:.3g} Hz" for source, step in steps.items())
    keep = ""
    for clue in states:
        if clue.quantity.name == "v_x" and clue.idle > STANDING:
            condition = f"v_x > {KEPT_ABOVE[clue.magnitude > SMALL_TOP]:g} m/s"
            keep = f', keep = "{condition}"'
            notes.append(f"the car stands for {100 * clue.idle:.0f} % of the rows: only rows with {condition} are kept")
    yield f"log = {{ dt = {dt:g}, gap = {GAP:g}{keep} }}  # s; {rates or 'no time was found'}"
    yield "# vehicle = { wheelbase = 2.7 }  # m: give it, and the checks can tell wrong units"
    gaps = [(file.source, file.clock.gaps(GAP)) for file in used if file.clock is not None]
    for source, silences in gaps:
        if len(silences):
            notes.append(
                f"{source} is silent {len(silences)} times for up to {silences.max():.3g} s: episodes end there"
            )
    clocks = [file.clock.stamps for file in used if file.clock is not None and len(file.clock.stamps)]
    if clocks and max(stamps.min() for stamps in clocks) >= min(stamps.max() for stamps in clocks):
        starts = ", ".join(f"{file.source} {file.clock.stamps[0]:.6g} s" for file in used if file.clock is not None)
        notes.append(f"the clocks of the files do not overlap: they start at {starts}; give offsets")


def _source(file: FileClues, notes: list[str]) -> Iterator[str]:
    yield f"[source.{file.source}]"
    yield f"file = {_quoted(file.ending)}"
    clock = file.clock
    if clock is None:
        yield "time = { rate = 100 }  # Hz: no time was found, say the rate"
        notes.append(f"{file.path.name} has no time: say its rate in the map")
    elif clock.toml:
        yield f"time = {clock.toml}" + (f"  # {one_line(clock.doubt)}" if clock.doubt else "")
        if clock.doubt:
            notes.append(f"{file.ending}, time: {one_line(clock.doubt)}")


def _states(states: Sequence[Clue], notes: list[str]) -> Iterator[str]:
    names = [clue.quantity.name for clue in states]
    for clue in states:
        yield _line(clue, [clue], notes)
    for name in ("v_x", "yaw_rate"):
        if name not in names:
            yield f'# {name} = {{ source = "...", column = "..." }}  # not found'
            notes.append(f"{name} was not found: name its column in the map")


def _inputs(inputs: Sequence[Sequence[Clue]], notes: list[str]) -> Iterator[str]:
    names = [clues[0].quantity.name for clues in inputs]
    for clues in inputs:
        yield _line(clues[0], clues, notes)
    if "steer" not in names:
        yield '# steer = { source = "...", column = "..." }  # not found'
        notes.append("steer was not found: name its column in the map")
    if not set(names) & set(DRIVING):
        notes.append("nothing was found that drives v_x: map a pedal, a torque or an acceleration, if there is one")


def _line(clue: Clue, clues: Sequence[Clue], notes: list[str]) -> str:
    """The line of a signal, and beside it what is doubted."""
    name = clue.quantity.name
    if len(clues) > 1:
        columns = ", ".join(_quoted(each.column) for each in clues)
        reduce = "sum" if name == "torque" else "mean"
        where = f'columns = [{columns}], reduce = "{reduce}"'
    else:
        where = f"column = {_quoted(clue.column)}"
    settings, doubts = "", []
    if clue.guessed and not clue.settled:
        doubts.append(f"unit guessed: up to {clue.largest:.3g}")
    if clue.beside:
        doubts.append("guessed from part of its name")
    words = set(words_of(clue.title))
    if name == "steer" and words & HAND_WHEEL and "road" not in words:
        settings = f", ratio = {RATIO}"
        doubts.append("the angle of the steering wheel: say the ratio of your steering")
    elif name == "steer" and clue.magnitude > WHEELS_TURN:
        settings = ", ratio = 1"
        doubts.append(f"the angle of the steering wheel? then its ratio, about {RATIO}")
    limits = LIMITS.get(name)
    if limits is not None and clue.magnitude > limits.high:
        doubts.append(f"is {name} in {limits.other}: unit = '{limits.other}'?")
    notes += [f"{name}, '{one_line(clue.title)}' of {clue.source}: {doubt}" for doubt in doubts]
    beside = f"  # {'; '.join(doubts)}" if doubts else ""
    return f'{name} = {{ source = "{clue.source}", {where}, unit = {_quoted(clue.unit)}{settings} }}{beside}'


def _quoted(value: str | int) -> str:
    return str(value) if isinstance(value, int) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
