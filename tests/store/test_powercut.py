"""What a store holds after a power cut at any moment of its work: every state that a disk may be left in is opened.

Commands under power cuts: ``make faults``.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from koopcli.errors import KoopError
from koopcli.store import Store
from koopcli.store.digests import slabs_path
from koopcli.store.identity import key_of
from koopcli.store.pins import pin, pins
from tests.faults import UNFINISHED, good
from tests.large import large_from
from tests.powercut.disk import Disk, Operation, Said, Synced, disk_of, lay_out, operations, states
from tests.powercut.recorder import Event, Events, recording
from tests.writer import LARGE, SLAB, commit, content, recipe

SEEDS = (0, 1)  # the second is large
KEPT = "kept"
MEMORY = Path("/dev/shm")


def work(root: Path, say: Callable[[str], None]) -> None:
    """Lock, commit and pin as commands do; what is committed is said."""
    store = Store(root)
    for seed in SEEDS:
        with store.lock(f"{seed:064}", "sample"):
            record = commit(store, seed)
        say(str(seed))
    pin(store, KEPT, [record])
    say(KEPT)


def recorded(top: Path, begin: Callable[[Path, Callable[[str], None]], None] = work) -> list[Event]:
    events = Events()
    top.mkdir(exist_ok=True)
    with recording(top, events):
        begin(top / "store", lambda text: events.add(("say", text)))
    return events


def said(done: Sequence[Operation]) -> frozenset[str]:
    return frozenset(operation.text for operation in done if isinstance(operation, Said))


def lost(root: Path, promised: Collection[str], keys: dict[int, str]) -> list[str]:
    """What was said to be committed and is not there, whole. Fails for whatever is wrong and looks healthy."""
    store, missing = Store(root), []
    for seed, key in keys.items():
        try:
            record = store.record("sample", key)
            whole = record is not None and store.has_object(record) and good(store, record)
            assert whole or record is None or not store.has_object(record), f"{seed} is wrong and was accepted"
        except KoopError:
            whole = False
        missing += [] if whole or str(seed) not in promised else [str(seed)]
    return missing + ([KEPT] if KEPT in promised and KEPT not in pins(store) else [])


@pytest.fixture(autouse=True)
def large():
    with large_from(LARGE, SLAB):
        yield


@pytest.fixture
def keys(tmp_path) -> dict[int, str]:
    return {seed: commit(Store(tmp_path / "names"), seed).key for seed in SEEDS}


def replay(top: Path, start: Disk, done: list[Operation], cuts: Iterable[int], keys: dict[int, str]) -> Counter[str]:
    """Count the states after the first so many operations, and those in which something promised is lost."""
    seen: dict[object, bool] = {}
    count: Counter[str] = Counter()
    for cut in cuts:
        promised = said(done[:cut])
        for state in states(start, done[:cut]):
            mark = promised, tuple(state.tree.items())
            if mark not in seen:
                shutil.rmtree(top, ignore_errors=True)
                lay_out(state.tree, top)
                seen[mark] = bool(lost(top / "store", promised, keys))
                work(top / "store", lambda text: None)
                assert lost(top / "store", [*map(str, SEEDS), KEPT], keys) == [], state.what
            count["states"] += 1
            count["lost"] += seen[mark]
            count["lost though a journal orders it"] += seen[mark] and state.allowed
    return count


@pytest.fixture
def unsynced(monkeypatch) -> None:
    """What is rebuilt need not last."""
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)


@pytest.fixture
def top() -> Iterator[Path]:
    """A folder in memory, where there is such a place: thousands of stores are laid out in it and removed."""
    with TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as name:
        yield Path(name) / "top"


def test_a_power_cut_at_any_moment_loses_nothing_that_was_said(top, keys, unsynced):
    done = operations(Disk(), recorded(top), top)
    whole = Disk()
    for operation in done:
        whole.apply(operation)
    assert whole.tree() == disk_of(top).tree(), "the recorded calls are all that happened"
    count = replay(top, Disk(), done, range(len(done) + 1), keys)
    assert count["states"] > 1000
    assert count["lost"] == 0


def test_the_replay_sees_what_is_not_synced(top, keys, unsynced):
    done = [operation for operation in operations(Disk(), recorded(top), top) if not isinstance(operation, Synced)]
    count = replay(top, Disk(), done, [len(done)], keys)
    assert count["lost"] > count["lost though a journal orders it"] > 0


def meet(root: Path, say: Callable[[str], None]) -> None:
    """Name what is there, as a command does on a hit; commit what is not."""
    store = Store(root)
    for seed in SEEDS:
        with store.lock(f"{seed:064}", "sample"):
            record = store.record("sample", key_of(recipe(seed)))
            if record is not None and store.has_object(record):
                store.sync(record)
            else:
                record = commit(store, seed)
        say(str(seed))
    pin(store, KEPT, [record])
    say(KEPT)


@pytest.mark.parametrize("second", [work, meet])
def test_what_a_killed_process_left_lasts_once_another_names_it(top, keys, unsynced, second):
    """Whatever was not synced when the second says something, a power cut takes away."""
    events = recorded(top)
    for killed in range(1, len(events) + 1):
        left = Disk()
        for operation in operations(Disk(), events[:killed], top):
            left.apply(operation)
        shutil.rmtree(top)
        lay_out(left.tree(), top)
        done = operations(Disk(), [*events[:killed], *recorded(top, second)], top)
        for cut, operation in enumerate(done, 1):
            if isinstance(operation, Said):
                worst = next(states(Disk(), done[:cut]))
                shutil.rmtree(top)
                lay_out(worst.tree, top)
                assert lost(top / "store", said(done[:cut]), keys) == [], f"{worst.what}: {events[killed - 1]}"


@pytest.mark.parametrize("seed", SEEDS, ids=["small", "large"])
def test_only_a_young_artefact_is_synced_before_it_is_named(top, unsynced, seed):
    """The object, its folder, the record, its folder; one from the future is taken for young."""
    top.mkdir()
    store = Store(top / "store")
    made = commit(store, seed)
    path, record = store.path(made), store.root / "records" / "sample" / f"{made.key}.json"
    slabs = [slabs_path(path), path.parent] if seed else []
    now = record.stat().st_mtime
    for age, synced in ((0, True), (-3600, True), (3600, False)):
        os.utime(record, (now - age,) * 2)
        events = Events()
        with recording(top, events):
            Store(store.root).sync(made)
        expected = [*slabs, path, path.parent, record, record.parent] if synced else []
        assert events == [("sync", str(place)) for place in expected]


def test_what_was_made_with_something_else_does_not_come_back(top, unsynced):
    """A chunk must not lie beside what it was not made with, whichever of the removals were not synced."""

    def begin_again(root: Path, say: Callable[[str], None]) -> None:
        parts = Store(root).parts(UNFINISHED)
        parts.drop(0)
        parts.commit(0, content(2))

    top.mkdir()
    parts = Store(top / "store").parts(UNFINISHED)
    for i in (0, 1):
        parts.commit(i, content(i))
    start = disk_of(top)
    done = operations(start, recorded(top, begin_again), top)
    for cut in range(len(done) + 1):
        for state in states(start, done[:cut]):
            shutil.rmtree(top)
            lay_out(state.tree, top)
            seeds = {i: part.meta["seed"] for i, part in Store(top / "store").parts(UNFINISHED).read({0, 1}).items()}
            assert seeds.get(0) != 2 or 1 not in seeds, state.what
