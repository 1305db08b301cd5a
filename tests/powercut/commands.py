"""Whole commands under power cuts: every command's calls on its store are recorded, every state that a power cut may
leave is rebuilt, and commands are run on it.

python -m tests.powercut.commands [NAME…] counts the states of some commands, or of all.
"""

from __future__ import annotations

import importlib
import io
import json
import multiprocessing
import os
import pkgutil
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import koopcli
from koopcli.__main__ import main as koop
from koopcli.errors import KoopError
from koopcli.store import Store
from koopcli.store.files import UntrustedFileError
from koopcli.store.identity import data_digest
from koopcli.store.pins import pins
from koopcli.store.provenance import provenance
from koopcli.store.survey import records
from tests.conftest import TINY
from tests.large import large_from
from tests.powercut.disk import Operation, Said, State, disk_of, lay_out, operations, states
from tests.powercut.recorder import FOLDER, LARGE, LOG, Event, events_in

MEMORY = Path("/dev/shm")
MOST = 150  # different states of a command that are tried, drawn at random where there are more
NAME = re.compile(r"\b[a-z][a-z-]*/[0-9a-f]{12}\b")
STORE = ["--store", "store"]
FIT = ["fit-edmd", "--experiment", "../tiny.toml", *STORE]
OTHER_FIT = ["fit-edmd", "--experiment", "../tiny.toml", "--order", "1", *STORE]
EVALUATE = ["evaluate", "--experiment", "../tiny.toml", "--set", "simulate.chunk=50", *STORE]
PIN = ["pin", "fit-edmd/", *STORE]
COLLECT = ["gc", "--delete", "--grace", "0", *STORE]
REPAIR = ["verify", "--repair", *STORE]


@dataclass(frozen=True)
class Scenario:
    """A ``command`` in a store that was begun by others and by ``spoil``; ``again`` goes on after a power cut.

    ``large``: as if every artefact were large. ``killed``: the command was killed when it had put a file whose path
    holds this text, and was then run once more.
    """

    command: list[str]
    begun_by: Sequence[list[str]] = ()
    spoil: Callable[[Path], None] = lambda store: None
    again: list[str] | None = None
    large: bool = False
    killed: str = ""


def damage(store: Path) -> None:
    """Flip a bit of a predictor, and damage the check of every record of an evaluation or a baseline."""
    record = min((store / "records" / "fit-edmd").iterdir())
    digest = json.loads(record.read_text())["object"]
    path = store / "objects" / digest[:2] / f"{digest}.h5"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    for stage in ("evaluate", "baseline"):
        for other in (store / "records" / stage).iterdir():
            other.write_text(other.read_text().replace('"check": "', '"check": "0'))


SCENARIOS = {
    "fit-edmd": Scenario(FIT),
    "fit-edmd, as if large": Scenario(FIT, large=True),
    "evaluate": Scenario(EVALUATE, [FIT]),
    "evaluate --workers 2": Scenario([*EVALUATE, "--workers", "2"], [FIT], again=EVALUATE),
    "pin": Scenario(PIN, [FIT]),
    "gc --delete": Scenario(COLLECT, [FIT, PIN, OTHER_FIT]),
    "verify --repair": Scenario(REPAIR, [EVALUATE], spoil=damage),
    "fit-edmd, killed and run again": Scenario(FIT, killed="/records/fit-edmd/"),
}


@dataclass(frozen=True)
class Result:
    """What is wrong with a state: names that are ``lost``, and anything else."""

    lost: list[str]
    wrong: list[str]


@dataclass(frozen=True)
class Check:
    """What a state is held to: what it must hold, what runs in it, and what the store holds afterwards."""

    tree: dict[str, bytes | None]
    promised: frozenset[str]
    good: dict[str, str]
    pins: dict[str, list[str]]
    again: list[str]

    def __call__(self) -> Result:
        """Lay the state out in a folder of this process, look into it and run the command again."""
        with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as name:
            top = Path(name)
            (top / "tiny.toml").write_text(TINY)
            lay_out(self.tree, top / "top")
            os.chdir(top / "top")
            os.fsync = lambda descriptor: None
            try:
                return self._look()
            finally:
                os.chdir("/")

    def _look(self) -> Result:
        seen = contents(Path("store"))
        wrong = [
            f"{name} is wrong and was accepted" for name, data in seen.items() if data != self.good.get(name, data)
        ]
        lost = [name for name in self.promised if "/" in name and seen.get(name) != self.good[name]]
        held = pins(Store(Path("store")))
        lost += [label for label in self.promised if "/" not in label and held.get(label) != self.pins[label]]
        for command in (["ls", *STORE], ["verify", *STORE], self.again):
            code, text = run(command)
            if "Traceback" in text or (command == self.again and code):
                wrong.append(f"koop {command[0]} ends with {code}: {text[-300:]}")
        after = contents(Path("store"))
        wrong += [f"{name} is not there in the end" for name, data in self.good.items() if after.get(name) != data]
        code, text = run(["verify", *STORE])
        return Result(lost, [*wrong, text[-300:]] if code else wrong)


def run(argv: list[str]) -> tuple[int, str]:
    """The exit code of a koop command in this process, and all that it says."""
    text = io.StringIO()
    with redirect_stdout(text), redirect_stderr(text):
        try:
            code = koop(argv)
        except Exception as error:
            return 1, f"{text.getvalue()} Traceback: {error!r}"
    return code, text.getvalue()


def contents(root: Path) -> dict[str, str]:
    """name -> data digest of every artefact that reads; nothing is moved."""
    store, readable = Store(root), {}
    for recorded in records(root).values():
        if recorded.record is not None:
            try:
                packed = store.inspect(recorded.record)
            except (KoopError, FileNotFoundError, UntrustedFileError):
                continue
            readable[recorded.record.name] = data_digest(packed)
    return readable


def recorded(top: Path, command: list[str], large: bool) -> list[Event]:
    """What a koop command does under ``top``, where it runs."""
    with tempfile.NamedTemporaryFile(dir=top.parent) as log:
        variables = {LOG: log.name, FOLDER: str(top), **({LARGE: "1"} if large else {})}
        words = [sys.executable, "-m", "tests.powercut.recorder", *command]
        source = str(Path(__file__).resolve().parents[2])
        environment = {**os.environ, **variables, "PYTHONPATH": source, "OPENBLAS_NUM_THREADS": "1"}
        subprocess.run(words, cwd=top, env=environment, check=True, capture_output=True)
        return events_in(Path(log.name))


def told(done: Sequence[Operation]) -> set[str]:
    """The names of artefacts that a command says it has, on stdout or as made or reused."""
    lines = "".join(operation.text for operation in done if isinstance(operation, Said)).splitlines()
    return {name for line in lines if NAME.fullmatch(line) or "made in" in line or "reused" in line
            for name in NAME.findall(line)}  # fmt: skip


def checks(top: Path, scenario: Scenario) -> Iterator[tuple[State, Check]]:
    """Every state of a command with what it is held to."""
    top.mkdir()
    (top.parent / "tiny.toml").write_text(TINY)
    for command in scenario.begun_by:
        subprocess.run([sys.executable, "-m", "koopcli", *command], cwd=top, check=True, capture_output=True)
    scenario.spoil(top / "store")
    start, before, kept = disk_of(top), contents(top / "store"), pins(Store(top / "store"))
    events = recorded(top, scenario.command, scenario.large)
    if scenario.killed:
        put = next(i for i, (kind, *what) in enumerate(events) if kind == "move" and scenario.killed in what[1])
        left = start.copy()
        for operation in operations(start, events[: put + 1], top):
            left.apply(operation)
        shutil.rmtree(top)
        lay_out(left.tree(), top)
        events = [*events[: put + 1], *recorded(top, scenario.command, scenario.large)]
    done = operations(start, events, top)
    whole = start.copy()
    for operation in done:
        whole.apply(operation)
    assert whole.tree() == disk_of(top).tree(), "the recorded calls are all that happened"
    good, pinned = contents(top / "store"), pins(Store(top / "store"))
    for cut in range(len(done) + 1):
        finished = set(pinned) if cut == len(done) else set()
        promised = frozenset((before.keys() & good.keys()) | (told(done[:cut]) & good.keys()) | kept.keys() | finished)
        for state in states(start, done[:cut]):
            yield state, Check(state.tree, promised, good, pinned, scenario.again or scenario.command)


def count(name: str) -> Counter[str]:
    """How many states of a command were tried, and in how many of them something is lost or wrong."""
    with large_from(0) if SCENARIOS[name].large else nullcontext():
        return _count(name)


def _count(name: str) -> Counter[str]:
    numbers: dict[object, int] = {}
    different: list[Check] = []
    every: list[tuple[int, str, bool]] = []
    same: dict[bytes | None, bytes | None] = {}  # what many states hold is held once
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        for state, check in checks(Path(folder) / "top", SCENARIOS[name]):
            tree = {path: same.setdefault(content, content) for path, content in state.tree.items()}
            mark = tuple(tree.items()), check.promised
            if mark not in numbers:
                numbers[mark] = len(different)
                different.append(replace(check, tree=tree))
            every.append((numbers[mark], state.what, state.allowed))
    drawn = random.Random(0).sample(range(len(different)), min(MOST, len(different)))
    with multiprocessing.get_context("fork").Pool(maxtasksperchild=1) as pool:
        results = dict(zip(drawn, pool.map(Check.__call__, [different[i] for i in drawn], chunksize=1), strict=True))
    total: Counter[str] = Counter(different=len(drawn))
    shown = set()
    for number, what, allowed in every:
        if number not in results:
            continue
        result = results[number]
        total["states"] += 1
        total["a journal allows"] += allowed
        total["lost"] += bool(result.lost)
        total["wrong"] += bool(result.wrong)
        if (result.lost or result.wrong) and number not in shown:
            shown.add(number)
            print(f"{name}: {what}: {result}", file=sys.stderr)
    return total


def row(name: str) -> str:
    """A line of the table in docs/reliability.md."""
    total = count(name)
    numbers = (total[key] for key in ("states", "a journal allows", "different", "lost", "wrong"))
    return f"| `{name}` | {' | '.join(map(str, numbers))} |"


def main(names: Sequence[str]) -> None:
    for module in pkgutil.walk_packages(koopcli.__path__, "koopcli."):  # once, for all processes that are forked
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    provenance(0.0)  # keeps what it asks git
    print("| power cut during | states | of them on a disk with a journal | different | lost | wrong |")
    print("|---|---|---|---|---|---|")
    for name in names or SCENARIOS:
        print(row(name), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
