"""Large objects: named by the digests of their slabs, and verified slab by slab as they are read."""

from __future__ import annotations

import gc
import hashlib
import io
import os
from pathlib import Path

import numpy as np
import pytest

from koopcli.console import Console
from koopcli.errors import DamagedArtefactError
from koopcli.records import Array, Packed
from koopcli.stages.repair import repair
from koopcli.store import Store, collect, digests, image
from koopcli.store.collect import plan, remove
from koopcli.store.files import DAY
from koopcli.store.identity import SCHEMA
from koopcli.store.verify import verify
from tests.large import large_from

SLAB = 1 << 10
ROWS = 4000  # of each array, 8 bytes each
RECIPE = {"schema": SCHEMA, "stage": "sample", "version": 1, "settings": {}, "inputs": {}}


@pytest.fixture(autouse=True)
def large():
    with large_from(1000, SLAB):
        yield


def packed() -> Packed:
    values = np.random.default_rng(0).normal(size=(3, ROWS))
    return Packed({f"x{i}": Array(x, ("row",), "m") for i, x in enumerate(values)}, {"n": ROWS})


@pytest.fixture
def record(store):
    return store.commit(RECIPE, {}, packed(), {})


def test_the_name_is_the_digest_of_the_digests(store, record):
    content = store.path(record).read_bytes()
    slabs = [hashlib.sha256(content[i : i + SLAB]).digest() for i in range(0, len(content), SLAB)]
    assert len(slabs) > 90
    beside = digests.slabs_path(store.path(record)).read_bytes()
    assert beside == b"".join(slabs)
    assert record.object == hashlib.sha256(beside).hexdigest()


def test_a_small_object_is_named_by_its_bytes(store, monkeypatch):
    monkeypatch.setattr(digests, "WHOLE", 1 << 20)
    record = store.commit(RECIPE, {}, packed(), {})
    assert record.object == hashlib.sha256(store.path(record).read_bytes()).hexdigest()
    assert not digests.slabs_path(store.path(record)).exists()


def test_there_and_back(store, record):
    again = store.read(record)
    assert image.loaded(again) == packed()
    assert image.loaded(again) == packed()  # what is verified is read once more


def test_whoever_reads_a_part_reads_and_hashes_that_part(store, record, monkeypatch):
    """The rows, at most two more slabs of each array, and the header."""
    whole, read = store.path(record).stat().st_size, []
    real = os.pread
    monkeypatch.setattr(os, "pread", lambda *args: read.append(real(*args)) or read[-1])
    arrays = store.read(record).arrays
    header = sum(map(len, read))
    assert header <= 8 * SLAB < whole / 10
    for array in arrays.values():
        assert len(array.values[1000:1300]) == 300
    assert sum(map(len, read)) - header <= 3 * (300 * 8 + 2 * SLAB)


def test_every_slab_is_guarded(store, record):
    path = store.path(record)
    good = path.read_bytes()
    for place in range(5, len(good), 5 * SLAB + 7):
        path.write_bytes(good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :])
        with pytest.raises(DamagedArtefactError, match="is damaged and was put aside: its bytes are not those"):
            image.loaded(store.read(record))
        assert not store.has_object(record)


@pytest.mark.parametrize("change", [lambda b: b[:-1], lambda b: b + b"x", lambda b: bytes([b[0] ^ 1]) + b[1:]])
def test_the_digests_are_guarded(store, record, change):
    path = digests.slabs_path(store.path(record))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(DamagedArtefactError, match="the digests of its slabs are not those that were stored"):
        store.read(record)
    assert store.commit(RECIPE, {}, packed(), {}) == record
    assert image.loaded(store.read(record)) == packed()


def test_without_its_digests_an_object_is_missing(store, record):
    digests.slabs_path(store.path(record)).unlink()
    assert not store.has_object(record)
    assert [finding.kind for finding in verify(store, lambda *_: None).findings] == ["missing digests"]
    with pytest.raises(DamagedArtefactError, match="missing"):
        store.read(record)


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system lists no descriptors")
def test_a_large_object_that_was_read_is_closed_at_once(store, record):
    gc.collect()
    gc.disable()
    try:
        open_before = len(os.listdir("/proc/self/fd"))
        for _ in range(20):
            assert len(store.read(record).arrays) == 3
        assert len(os.listdir("/proc/self/fd")) <= open_before
    finally:
        gc.enable()


def lose(path):
    path.unlink()


def cut(path):
    path.write_bytes(path.read_bytes()[:-1])


def change(path):
    content = bytearray(path.read_bytes())
    content[7] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("harm", [lose, cut, change])
def test_digests_that_are_wrong_are_found_and_written_anew(store, record, harm):
    path = store.path(record)
    beside = digests.slabs_path(path)
    good, before = beside.read_bytes(), path.stat()
    harm(beside)
    for opens in (None, lambda *_: None):
        if opens is None and harm is change:
            continue
        report = verify(store, opens)
        (finding,) = report.findings
        assert finding.kind == ("missing digests" if harm is lose else "damaged digests")
        assert (finding.path, finding.artefact) == (str(beside.relative_to(store.root)), f"sample/{record.key}")
        assert finding.damage
    (mended,) = repair(store, Console(), report.findings)
    assert mended.repaired
    assert beside.read_bytes() == good
    assert path.stat() == before
    assert verify(store, lambda *_: None).findings == ()
    assert (store.root / "quarantine").exists() == (harm is not lose)
    assert store.restore_digests(record.object)
    assert image.loaded(store.read(record)) == packed()


@pytest.mark.parametrize("harm", [lose, cut, change])
def test_digests_are_not_taken_from_a_damaged_object(store, record, harm):
    path = store.path(record)
    harm(digests.slabs_path(path))
    change(path)
    kinds = [finding.kind for finding in verify(store, lambda *_: None).findings]
    assert kinds == ["missing digests" if harm is lose else "damaged digests", "damaged object"]
    assert not store.restore_digests(record.object)
    cut(path)
    assert verify(store, None).findings[-1].kind == "damaged object"
    path.unlink()
    assert [finding.kind for finding in verify(store, None).findings] == ["missing object"]
    assert not store.restore_digests(record.object)


def test_what_others_have_put_right_is_not_put_aside(store, record):
    path = store.path(record)
    good = path.read_bytes()
    path.write_bytes(good[:-9] + b"x" + good[-8:])
    arrays = store.read(record).arrays
    path.unlink()
    path.write_bytes(good)
    with pytest.raises(DamagedArtefactError, match="no longer"):
        [array.values[...] for array in arrays.values()]
    assert store.has_object(record)


def test_verify_reads_every_slab(store, record):
    path = store.path(record)
    content = bytearray(path.read_bytes())
    assert verify(store, lambda *_: None).findings == ()
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    (finding,) = verify(store, lambda *_: None).findings
    assert (finding.kind, finding.artefact) == ("damaged object", f"sample/{record.key}")
    (store.root / "records" / "sample" / f"{record.key}.json").unlink()
    (finding,) = verify(store, lambda *_: None).findings
    assert "do not match its name" in finding.what


def files(store):
    return sorted(path.name for path in (store.root / "objects").glob("*/*"))


def old(store):
    for path in store.root.rglob("*"):
        os.utime(path, (0, 0))


def test_an_object_goes_with_its_digests(store, record):
    old(store)
    remove(store, plan(store, DAY, delete=True))
    assert files(store) == []


def test_digests_alone_are_found_and_removed(store, record):
    store.path(record).unlink()
    (store.root / "records" / "sample" / f"{record.key}.json").unlink()
    old(store)
    assert [finding.kind for finding in verify(store, None).findings] == ["orphan object"]
    remove(store, plan(store, DAY, delete=True))
    assert files(store) == []


def test_cut_off_after_the_move_the_next_collection_puts_both_back(store, record, monkeypatch):
    (store.root / "records" / "sample" / f"{record.key}.json").unlink()
    old(store)
    with monkeypatch.context() as patch:
        patch.setattr(collect, "_settle", lambda store, away: None)
        remove(store, plan(store, DAY, delete=True))
    assert not store.has_object(record)
    assert len(files(store)) == 2
    (store.root / "records" / "sample" / f"{record.key}.json").write_bytes(record.to_json())
    remove(store, plan(store, DAY, delete=True))
    assert image.loaded(Store(store.root).read(record)) == packed()


def test_named_from_memory_it_is_the_same(store, record):
    assert digests.named(io.BytesIO(store.path(record).read_bytes()))[0] == record.object
