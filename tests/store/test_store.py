from __future__ import annotations

import errno
import json
import os

import numpy as np
import pytest
from filelock import FileLock

from koopcli.errors import (
    DamagedArtefactError,
    InvalidValueError,
    LockTimeoutError,
    NewerFormatError,
    StorageError,
    UnknownNameError,
)
from koopcli.records import Array, Packed
from koopcli.store import Store, identity, image
from koopcli.store import parts as parts_module
from koopcli.store.code import code_digest
from koopcli.store.files import make_folder, publish, size_text, sweep
from koopcli.store.identity import SCHEMA
from koopcli.store.names import store_root
from koopcli.store.pins import pin, pins, unpin
from koopcli.store.records import _check
from tests.large import large_from


def packed(value=1.0, n=4) -> Packed:
    return Packed({"x": Array(np.full(n, value), ("row",), "m")}, {"value": value})


def recipe(seed=0, stage="sample"):
    return {"schema": SCHEMA, "stage": stage, "version": 1, "settings": {"seed": seed, "width": 0.1}, "inputs": {}}


def commit(store, seed=0, value=1.0, stage="sample"):
    return store.commit(recipe(seed, stage), {}, packed(value), {"time": "2026-01-01", "seconds": 0.0})


def test_committed_and_read_again(store):
    made = commit(store)
    found = Store(store.root).record("sample", made.key)
    assert found == made
    assert found.name == f"sample/{made.key[:12]}"
    assert (Store(store.root).read(found).arrays["x"].values[...] == 1).all()
    assert store.record("sample", "0" * 64) is None


def test_equal_content_is_stored_once(store):
    one, two = commit(store, 1), commit(store, 2)
    assert one.key != two.key
    assert store.path(one) == store.path(two)


def test_names_resolve_by_any_unambiguous_beginning(store):
    records = [commit(store, seed) for seed in range(20)] + [commit(store, 0, stage="simulate")]
    one = records[3]
    for text in (one.name, one.key, f"sample/{one.key}"):
        assert store.find(text) == one
    assert store.find("simulate") == records[-1]
    with pytest.raises(UnknownNameError, match=r"'sample' is ambiguous: .* and 12 more"):
        store.find("sample")
    for unknown in ("plot", "zzz", ""):
        with pytest.raises(UnknownNameError, match="koop ls"):
            store.find(unknown)


@pytest.mark.parametrize("where", [0, 8, 500, -1])
def test_a_flipped_bit_is_found_and_the_object_put_aside(store, where):
    record = commit(store)
    path = store.path(record)
    content = bytearray(path.read_bytes())
    content[where] ^= 1
    path.write_bytes(content)
    with pytest.raises(DamagedArtefactError, match="put aside"):
        store.read(record)
    assert not path.exists()
    assert (store.root / "quarantine" / path.name).read_bytes() == content
    with pytest.raises(DamagedArtefactError, match="missing"):
        store.read(record)
    assert not store.has_object(record)


@pytest.mark.parametrize("large", [False, True])
def test_large_content_goes_through_a_file(store, large):
    with large_from(100 if large else 1 << 30):
        record = store.commit(recipe(), {}, packed(n=10_000), {})
        assert store.path(record).stem == record.object
        assert (store.read(record).arrays["x"].values[...] == 1).all()
        assert not list((store.root / "tmp").iterdir())
        content = bytearray(store.path(record).read_bytes())
        content[-1] ^= 1
        store.path(record).write_bytes(content)
        with pytest.raises(DamagedArtefactError):
            image.loaded(store.read(record))


@pytest.mark.parametrize("limit", [image.IMAGE_LIMIT, 8], ids=["in memory", "by a file"])
def test_facts_that_could_not_be_read_are_refused_before_they_are_written(store, monkeypatch, limit):
    monkeypatch.setattr(image, "IMAGE_LIMIT", limit)
    monkeypatch.setattr(image, "META_LIMIT", 2000)
    room = 2000 - len('{"text": ""}')
    whole = Packed(packed().arrays, {"text": "x" * room})
    assert store.read(store.commit(recipe(), {}, whole, {})).meta == whole.meta
    before = set(store.root.rglob("*"))
    with pytest.raises(InvalidValueError, match=r"take 2\.0 kB, over 2\.0 kB"):
        store.commit(recipe(1), {}, Packed(packed().arrays, {"text": "x" * (room + 1)}), {})
    assert set(store.root.rglob("*")) == before


@pytest.mark.parametrize("limit", [image.IMAGE_LIMIT, 100], ids=["in memory", "by a file"])
@pytest.mark.parametrize("shape", [(400,), (70, 5), (3, 4, 50)])
def test_every_value_comes_back_from_many_slabs(store, monkeypatch, limit, shape):
    """Compared with the values themselves: bytes and digest come from the same slabs."""
    monkeypatch.setattr(identity, "SLAB", 100)
    monkeypatch.setattr(image, "IMAGE_LIMIT", limit)
    values = np.random.default_rng(0).standard_normal(shape)
    made = store.commit(recipe(), {}, Packed({"x": Array(values, ("a", "b", "c")[: values.ndim], "m")}, {}), {})
    assert (Store(store.root).read(made).arrays["x"].values[...] == values).all()


@pytest.mark.parametrize("large", [False, True])
def test_a_write_that_takes_less_than_it_was_given_goes_on(store, monkeypatch, large):
    real = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda descriptor, content, place: real(descriptor, content[:7], place))
    if large:
        monkeypatch.setattr(image, "IMAGE_LIMIT", 100)
    values = np.random.default_rng(0).standard_normal(200)
    made = store.commit(recipe(), {}, Packed({"x": Array(values, ("row",), "m")}, {}), {})
    assert Store(store.root).record("sample", made.key) == made
    assert (store.read(made).arrays["x"].values[...] == values).all()


def test_damage_is_never_lost_in_quarantine(store):
    for n in (1, 2, 3):
        record = commit(store)
        store.path(record).write_bytes(b"x" * n)
        with pytest.raises(DamagedArtefactError):
            store.read(record)
    assert sorted(len(path.read_bytes()) for path in (store.root / "quarantine").iterdir()) == [1, 2, 3]


def test_every_byte_of_a_record_is_guarded(store):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    good = path.read_bytes()
    for where in range(0, len(good), 7):
        bad = bytearray(good)
        bad[where] ^= 1
        path.write_bytes(bad)
        warned = []
        try:
            found = Store(store.root, warned.append).record("sample", record.key)
        except NewerFormatError:
            assert b'"schema"' in good[max(0, where - 12) : where + 12]  # 1 became a higher number
            continue
        if found is None:
            assert "put aside" in warned[0]
        else:
            assert found == record  # white space
    path.write_bytes(good[: len(good) // 2])
    assert Store(store.root).record("sample", record.key) is None


def test_a_record_under_another_key_is_refused(store):
    record = commit(store)
    folder = store.root / "records" / "sample"
    os.rename(folder / f"{record.key}.json", folder / f"{'0' * 64}.json")
    assert store.record("sample", "0" * 64) is None


def test_a_newer_record_is_left_alone(store):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema": SCHEMA + 1}))
    with pytest.raises(NewerFormatError, match="update koop"):
        store.record("sample", record.key)
    assert path.exists()


def make_older(path):
    """Give the record at ``path`` the format before."""
    old = {**json.loads(path.read_text()), "schema": SCHEMA - 1}
    del old["check"]
    path.write_text(json.dumps({**old, "check": _check(old)}))


def test_a_record_of_an_older_format_is_named_and_left_alone(store):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    make_older(path)
    before = path.read_bytes()
    with pytest.raises(NewerFormatError, match=r"written by an older koop .* make it afresh in another --store"):
        store.record("sample", record.key)
    assert path.read_bytes() == before


def failing_on(real, n, code):
    """``real``, failing on its n-th call."""
    count = 0

    def call(*args, **kwargs):
        nonlocal count
        count += 1
        if count == n:
            raise OSError(code, os.strerror(code))
        return real(*args, **kwargs)

    return call


@pytest.mark.parametrize("call", ["open", "pwrite", "fsync", "replace"])
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO, errno.EROFS])
def test_an_error_at_any_write_leaves_the_old_state_or_the_new(store, monkeypatch, call, code):
    """Fail the n-th call of each kind, for every n of a commit: nothing committed is lost, nothing half is found."""
    old = commit(store, 1)
    refused = 0
    for seed in range(2, 30):
        with monkeypatch.context() as patch:
            patch.setattr(os, call, failing_on(getattr(os, call), seed - 1, code))
            try:
                commit(store, seed, value=float(seed))
            except StorageError:
                refused += 1
        shelf = Store(store.root)
        assert shelf.record("sample", old.key) == old
        for stage, key in shelf.index():
            shelf.read(shelf.record(stage, key))
        assert not list((store.root / "tmp").iterdir())
        if len(shelf.index()) > 1:
            break
        commit(store, seed, value=float(seed))
        for stage, key in Store(store.root).index():
            if key != old.key:
                (store.root / "records" / stage / f"{key}.json").unlink()
    assert refused > 0


def test_a_full_disk_says_what_was_needed(store, monkeypatch):
    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(StorageError, match=r"No space left on device \(80\.0 kB needed, .* free\)"):
        store.commit(recipe(), {}, packed(n=10_000), {})
    assert not list((store.root / "tmp").iterdir())


def test_a_store_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "x").write_text("")
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("x", "link"):
        with pytest.raises(StorageError, match="not a folder"):
            Store(tmp_path / name)


def test_a_held_lock_times_out(store, monkeypatch):
    monkeypatch.setenv("KOOP_LOCK_TIMEOUT", "0.1")
    warned = []
    shelf = Store(store.root, warned.append)
    make_folder(store.root / "locks")
    with FileLock(store.root / "locks" / "abc.lock"):
        with pytest.raises(LockTimeoutError, match="KOOP_LOCK_TIMEOUT"), shelf.lock("abc", "sample/abc"):
            pass
        assert "waiting" in warned[0]
    with shelf.lock("abc", "sample/abc"):
        pass


def test_a_lock_is_for_those_whom_the_umask_lets_in(store):
    before = os.umask(0o002)
    try:
        with store.lock("abc", "sample/abc"):
            assert (store.root / "locks" / "abc.lock").stat().st_mode & 0o777 == 0o664
    finally:
        os.umask(before)


@pytest.mark.parametrize("error", [NotImplementedError(), OSError(errno.ENOLCK, "No locks available")])
def test_a_file_system_without_locks_is_a_warning(store, monkeypatch, error):
    def refuse(self, *args, **kwargs):
        raise error

    monkeypatch.setattr(FileLock, "acquire", refuse)
    warned = []
    with Store(store.root, warned.append).lock("abc", "sample/abc"):
        pass
    assert "twice" in warned[0]


def test_parts_are_verified_and_cleared(store):
    parts = store.parts("k" * 64)
    assert parts.read(range(20)) == {}
    parts.commit(0, packed(1.0))
    parts.commit(10, packed(2.0))
    parts.commit(12, packed(3.0))
    assert {i: found.meta["value"] for i, found in parts.read({0, 1, 10}).items()} == {0: 1.0, 10: 2.0}
    assert parts.size() == sum(path.stat().st_size for path in (store.root / "partial").rglob("*.h5"))
    (path,) = (store.root / "partial").rglob("10-*.h5")
    path.write_bytes(path.read_bytes()[:-1])
    assert parts.read(range(20)).keys() == {0, 12}
    os.mkfifo(path.parent / f"13-{'0' * 64}-{code_digest()}.h5")
    assert parts.read(range(20)).keys() == {0, 12}
    parts.clear()
    assert not (store.root / "partial" / ("k" * 64)).exists()


def test_parts_of_other_code_are_never_read_and_are_dropped(store, monkeypatch):
    """Nor are those of a koop that did not yet say in their names which code made them."""
    parts = store.parts("k" * 64)
    parts.commit(0, packed(1.0))
    with monkeypatch.context() as patch:
        patch.setattr(parts_module, "code_digest", lambda: "1" * 64)
        parts.commit(0, packed(2.0))
        parts.commit(1, packed(3.0))
    (path,) = (store.root / "partial").rglob("1-*.h5")
    path.rename(path.with_name(f"2-{path.name.split('-')[1]}.h5"))
    assert {i: found.meta["value"] for i, found in parts.read(range(9)).items()} == {0: 1.0}
    assert parts.drop_others() == 2
    assert parts.drop_others() == 0
    assert len(list((store.root / "partial").rglob("*.h5"))) == 1


def test_chunks_of_a_finished_artefact_are_swept(store):
    record = commit(store)
    again = commit(store, seed=1, value=7.0)
    store.path(again).unlink()  # recorded, but its object is gone: someone may be making it again
    for key in (record.key, again.key, "0" * 64):
        store.parts(key).commit(0, packed())
    commit(Store(store.root), seed=5)
    assert {path.name for path in (store.root / "partial").iterdir()} == {again.key, "0" * 64}


def test_pins(store):
    one, two = commit(store, 1), commit(store, 2)
    pin(store, "both", [one, two])
    assert pins(store) == {"both": sorted([f"sample/{one.key}", f"sample/{two.key}"])}
    before = (store.root / "refs" / "both.json").stat().st_mtime_ns
    pin(store, "both", [two, one])
    assert (store.root / "refs" / "both.json").stat().st_mtime_ns == before
    unpin(store, "both")
    assert pins(store) == {}
    with pytest.raises(UnknownNameError, match="not pinned"):
        unpin(store, "both")


def test_litter_of_dead_processes_is_swept_by_the_file_systems_clock(tmp_path):
    import socket

    host = socket.gethostname()
    names = {"gone": f"4194304-aa@{host}", "mine": f"{os.getpid()}-bb@{host}", "elsewhere": "1-cc@another"}
    for name in names.values():
        (tmp_path / name).write_text("")
    now = (tmp_path / names["gone"]).stat().st_mtime
    sweep(tmp_path, now + 60)
    assert len(list(tmp_path.iterdir())) == 3
    sweep(tmp_path, now + 7200)
    assert {p.name for p in tmp_path.iterdir()} == {names["mine"], names["elsewhere"]}
    sweep(tmp_path, now + 100_000)
    assert not list(tmp_path.iterdir())


def test_the_first_commit_of_a_store_sweeps_litter(store):
    commit(store)
    litter = store.root / "tmp" / "1-cc@another"
    litter.write_text("")
    os.utime(litter, (1, 1))
    commit(store, 1)
    assert litter.exists()  # once a process is enough
    commit(Store(store.root), 2)
    assert not litter.exists()


def test_publish_never_leaves_half_a_file(tmp_path):
    def break_off(path):
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        publish(tmp_path / "x", break_off, tmp_path / "tmp")
    assert not (tmp_path / "x").exists()
    assert not list((tmp_path / "tmp").iterdir())


def test_where_the_store_is(monkeypatch, tmp_path):
    monkeypatch.delenv("KOOP_STORE", raising=False)
    assert str(store_root()) == "artefacts"
    monkeypatch.setenv("KOOP_STORE", str(tmp_path))
    assert store_root() == tmp_path
    assert str(store_root("here")) == "here"


def test_sizes_for_people():
    assert [size_text(n) for n in (0, 999, 1500, 2.5e9)] == ["0 B", "999 B", "1.5 kB", "2.5 GB"]


@pytest.mark.parametrize("what", ["object", "record"])
def test_what_others_have_put_right_is_not_put_aside(store, monkeypatch, what):
    """Two readers meet the same damage; the slower one finds it mended by the quicker."""
    from koopcli.store import store as module

    record = commit(store)
    path = store.path(record) if what == "object" else store.root / "records" / "sample" / f"{record.key}.json"
    good = path.read_bytes()
    path.write_bytes(good[:-9])
    read = "_verified" if what == "object" else "read_small"
    real, calls = getattr(module, read), []

    def mended(*args):
        calls.append(args)
        try:
            return real(*args) if len(calls) > 1 or what == "object" else good[:-9]
        finally:
            publish(path, good, store.root / "tmp")

    monkeypatch.setattr(module, read, mended)
    if what == "object":
        assert (store.read(record).arrays["x"].values == 1).all()
    else:
        assert store.record("sample", record.key) == record
    assert len(calls) == 2
    assert not (store.root / "quarantine").exists()


def test_a_large_object_is_read_though_it_is_replaced_or_removed_meanwhile(store, monkeypatch):
    real = image.from_open

    def overtaken(opened):
        store.path(record).unlink()
        return real(opened)

    with large_from(100):
        record = store.commit(recipe(), {}, packed(n=10_000), {})
        monkeypatch.setattr(image, "from_open", overtaken)
        found = store.read(record)
        assert (found.arrays["x"].values[...] == 1).all()


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "soon"])
def test_an_odd_time_to_wait_is_refused(store, monkeypatch, text):
    monkeypatch.setenv("KOOP_LOCK_TIMEOUT", text)
    make_folder(store.root / "locks")
    with (
        FileLock(store.root / "locks" / "abc.lock"),
        pytest.raises(InvalidValueError, match="KOOP_LOCK_TIMEOUT"),
        Store(store.root).lock("abc", "sample/abc"),
    ):
        pass


@pytest.mark.parametrize(
    "change", [{"version": None}, {"settings": None}, {"inputs": None}, {"inputs": {"of": "x"}}, {"version": True}]
)
def test_a_record_that_says_too_little_is_damaged(store, change):
    bad = {name: value for name, value in {**recipe(), **change}.items() if value is not None}
    record = store.commit(bad, {}, packed(), {})
    assert store.record("sample", record.key) is None
