"""Stage ``import``: a log on one grid, in episodes, from its files and a map."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from koopcli.checks import restored
from koopcli.errors import UnknownNameError
from koopcli.logs.files import runs_of
from koopcli.logs.imported import Log
from koopcli.logs.log import import_log
from koopcli.logs.map import LogMap, essential_map
from koopcli.records import Meta
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task

A_BYTE = 2e-8  # seconds
STAGE_NAME = "import"


@dataclass(frozen=True)
class Import:
    """What a log is known by: its ``map`` as JSON, and the digest of each of its ``files`` with its run and source."""

    map: str
    files: tuple[str, ...]

    @cached_property
    def _channels(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        parsed = json.loads(self.map)
        outer = tuple(parsed.get("exogenous", ()))
        states = [_result(signal["name"]) for signal in parsed["states"]]
        inputs = [signal["name"] for signal in parsed["inputs"]]
        return tuple(name for name in states if name not in outer), (*inputs, *outer)

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states."""
        return self._channels[0]

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the inputs."""
        return self._channels[1]

    @property
    def dt(self) -> float | None:
        """The sampling period in s; None where the log tells it."""
        period: float | None = json.loads(self.map).get("dt")
        return period


def _result(name: str) -> str:
    return "v_y" if name == "side_slip" else name


_AT_HAND: dict[Import, tuple[Sequence[Path], LogMap]] = {}  # where the files of logs lie, which is in no key


def imported(files: Sequence[Path], log_map: LogMap) -> Task:
    """The log of ``files``, each read once for its digest. Raises ``InvalidValueError`` as ``runs_of``."""
    digests = []
    for i, run in enumerate(runs_of(files, log_map)):
        named = {**run.files, **{f"{source} (time)": path for source, path in run.times.items()}}
        digests += [f"{i}/{source} {_digest(path)}" for source, path in sorted(named.items())]
    settings = Import(json.dumps(essential_map(log_map), sort_keys=True), tuple(digests))
    _AT_HAND[settings] = [path.absolute() for path in files], log_map
    return Task(STAGE_NAME, settings)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _run(settings: Import, inputs: Inputs, context: Context) -> Log:
    if settings not in _AT_HAND:
        raise UnknownNameError(
            "the files of this log are not at hand, since a store keeps none: import them again with koop import FILE… "
            "--map MAP"
        )
    files, log_map = _AT_HAND[settings]
    log = import_log(files, log_map, context.progress)
    for note in log.notes:
        context.warn(note)
    return log


def _describe(figures: Meta, settings: Import) -> str:
    flagged = [check["verdict"] for check in figures["checks"] if check["verdict"] != "ok"]
    counts = [f"{flagged.count(verdict)} {verdict}" for verdict in dict.fromkeys(flagged)]
    text = f"{figures['rows']:,} rows in {figures['episodes']} episodes, {figures['seconds_logged']:.1f} s"
    return f"{text}; {len(figures['checks'])} checks, {', '.join(counts) or 'all healthy'}"


def _estimate(task: Task) -> Cost:
    size = sum(path.stat().st_size for path in _AT_HAND[task.settings][0]) if task.settings in _AT_HAND else 0
    return Cost(A_BYTE * size, 0.5 * size)


def channels(task: Task) -> tuple[int, int]:
    """How many states and inputs the log of a ``task`` has."""
    settings: Import = task.settings
    return len(settings.states), len(settings.inputs)


STAGE = Stage(
    name=STAGE_NAME,
    version=1,
    settings=lambda values: restored(Import, values),
    run=_run,
    unpack=Log.unpack,
    figures=Log.figures,
    describe=_describe,
    check=lambda task: None,
    estimate=_estimate,
)
