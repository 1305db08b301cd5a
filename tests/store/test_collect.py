"""What a collection removes and keeps, by which clock, and that nobody who commits meanwhile loses anything."""

from __future__ import annotations

import json
import os
import threading
import time

import pytest
from filelock import FileLock

from koopcli.errors import DamagedArtefactError
from koopcli.store import Store, collect
from koopcli.store.collect import plan, remove
from koopcli.store.files import DAY, make_folder
from koopcli.store.identity import SCHEMA
from koopcli.store.pins import pin, unpin
from koopcli.store.verify import verify
from tests.store.test_store import packed

WEEK = 7 * DAY


def recipe(seed=0, stage="sample", inputs=None):
    return {"schema": SCHEMA, "stage": stage, "version": 1, "settings": {"seed": seed}, "inputs": inputs or {}}


def commit(store, seed=0, value=None, stage="sample", of=None, days=0.0):
    """An artefact ``days`` old, made from the record ``of``."""
    inputs, lineage = ({"data": of.data}, {"data": f"{of.stage}/{of.key}"}) if of else ({}, {})
    content = packed(float(seed) if value is None else value)
    made = store.commit(recipe(seed, stage, inputs), lineage, content, {"time": "2026-01-01", "seconds": 0.0})
    if days:
        age(days, record_path(store, made), store.path(made))
    return made


def age(days, *paths):
    for path in paths:
        os.utime(path, (time.time() - days * DAY,) * 2)


def record_path(store, record):
    return store.root / "records" / record.stage / f"{record.key}.json"


def there(store):
    return {key for _, key in store.index()}


def collected(store, grace=WEEK):
    return remove(store, plan(store, grace, delete=True))


def read_all(store):
    for stage, key in store.index():
        store.read(store.record(stage, key))
    return len(store.index())


def test_pins_and_the_young_keep_what_they_were_made_from(store):
    root = commit(store, 1, days=30)
    middle = commit(store, 2, stage="simulate", of=root, days=30)
    pinned = commit(store, 3, stage="fit-edmd", of=middle, days=30)
    ground = commit(store, 4, days=30)
    young = commit(store, 5, stage="simulate", of=ground)
    old = commit(store, 6, days=30)
    child = commit(store, 7, stage="simulate", of=old, days=30)
    pin(store, "kept", [pinned])
    planned = plan(store, WEEK)
    assert {one.name for one in planned.removals} == {old.name, child.name}
    assert planned.kept == 5
    assert len(there(store)) == 7
    done = collected(store)
    assert {one.name for one in done} == {old.name, child.name}
    assert sum(one.size for one in done) == planned.size > 0
    assert there(store) == {one.key for one in (root, middle, pinned, ground, young)}
    assert read_all(store) == 5
    assert len(list((store.root / "objects").rglob("*.h5"))) == 5
    assert collected(store) == []
    unpin(store, "kept")
    collected(store)
    assert there(store) == {ground.key, young.key}


def test_age_is_told_by_the_stores_own_clock(store, monkeypatch):
    """The computer's clock may be ten years off; a file from the future is young."""
    old, young, future = commit(store, 1, days=8), commit(store, 2, days=6), commit(store, 3, days=-3650)
    for off in (-3650 * DAY, 3650 * DAY):
        now = time.time() + off
        with monkeypatch.context() as patch:
            patch.setattr(time, "time", lambda now=now: now)
            assert [one.name for one in plan(store, WEEK).removals] == [old.name]
    collected(store)
    assert there(store) == {young.key, future.key}
    age(3650, record_path(store, young), store.path(young))
    collected(store, 3000 * DAY)
    assert there(store) == {future.key}
    collected(store, 0)
    assert there(store) == {future.key}


def test_no_grace_removes_what_was_just_made(store):
    commit(store)
    assert len(collected(store, 0)) == 1
    assert there(store) == set()
    assert not list((store.root / "objects").rglob("*.h5"))


def test_equal_content_stays_while_one_of_its_records_does(store):
    old, new = commit(store, 1, value=1.0, days=30), commit(store, 2, value=1.0)
    assert store.path(old) == store.path(new)
    age(30, store.path(old))
    assert plan(store, WEEK).size < store.path(new).stat().st_size
    (done,) = collected(store)
    assert done.size < store.path(new).stat().st_size
    assert there(store) == {new.key}
    assert read_all(store) == 1
    third = commit(store, 3, value=1.0, days=30)
    age(30, record_path(store, new))
    found = collected(store)
    assert {one.name for one in found} == {new.name, third.name}
    assert not list((store.root / "objects").rglob("*.h5"))
    assert sum(one.size for one in found) > sum(one.files[0].size for one in found)


def test_orphans_and_litter_go_when_they_are_old(store):
    keep = commit(store, 1)
    for seed, days in ((2, 30), (3, 1)):
        orphan = commit(store, seed, days=days)
        record_path(store, orphan).unlink()
    for name, days in (("1" * 64, 30), ("2" * 64, 1)):
        store.parts(name).commit(0, packed())
        age(days, *(store.root / "partial" / name).iterdir())
        make_folder(store.root / "locks")
        (store.root / "locks" / f"{name}.lock").touch()
        age(days, store.root / "locks" / f"{name}.lock")
    litter = store.root / "tmp" / f"{os.getpid()}-{'0' * 16}@here"
    litter.touch()
    age(2, litter)
    (store.root / "quarantine").mkdir()
    (store.root / "quarantine" / "bad.h5").touch()
    age(3000, store.root / "quarantine" / "bad.h5")
    done = collected(store)
    assert sorted(one.kind for one in done) == ["chunks", "lock", "orphan object", "temporary file"]
    assert [path.name for path in (store.root / "partial").iterdir()] == ["2" * 64]
    assert [path.stem for path in (store.root / "locks").iterdir()] == ["2" * 64]
    assert len(list((store.root / "objects").rglob("*.h5"))) == 2
    assert not litter.exists()
    assert (store.root / "quarantine" / "bad.h5").exists()
    assert there(store) == {keep.key}


def test_what_does_not_read_here_keeps_what_it_names(store):
    base = commit(store, 1, days=30)
    newer = commit(store, 2, stage="simulate", of=base, days=30)
    orphan = commit(store, 3, days=30)
    record_path(store, orphan).unlink()
    gone = commit(store, 4, days=30)
    path = record_path(store, newer)
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema": SCHEMA + 1}))
    age(30, path)
    assert [one.name for one in collected(store)] == [gone.name]
    assert store.path(newer).exists()
    assert store.path(orphan).exists()
    assert record_path(store, base).exists()
    path.write_text("{")
    age(30, path)
    collected(store)
    assert path.exists()
    assert not record_path(store, base).exists()  # nothing names it any more
    assert store.path(newer).exists()


def damage(text):
    return text.replace('"check"', '"Check"')


def cut_behind_its_recipe(text):
    return text[: text.index('"lineage"')]


def put_aside(store, record, change=damage):
    """Damage the record in place, and let a command meet it."""
    path = record_path(store, record)
    path.write_text(change(path.read_text()))
    assert store.record(record.stage, record.key) is None


@pytest.mark.parametrize("change", [damage, cut_behind_its_recipe])
def test_what_was_put_aside_and_can_be_made_again_keeps_what_it_was_made_from(store, change):
    base = commit(store, 1, days=30)
    lost = commit(store, 2, stage="simulate", of=base, days=30)
    gone = commit(store, 3, days=30)
    put_aside(store, lost, change)
    planned = plan(store, 0, delete=True)
    assert planned.kept == 1
    assert [one.name for one in remove(store, planned) if one.kind == "artefact"] == [gone.name]
    assert there(store) == {base.key}
    (aside,) = (store.root / "quarantine").iterdir()
    aside.unlink()
    collected(store)
    assert there(store) == set()


def test_what_is_removed_is_not_taken_for_lost(store):
    """Its record had once been put aside, and it was made again."""
    put_aside(store, commit(store, 1))
    commit(store, 1, days=30)
    assert len(collected(store)) == 1
    assert there(store) == set()
    assert verify(store, None).findings == ()
    assert len(list((store.root / "quarantine").iterdir())) == 1


@pytest.mark.parametrize("text", ["", "{}", '{"names": 3}', '{"names": ["sample"]}', '{"names": [3]}'])
def test_a_damaged_pin_stops_everything(store, text):
    commit(store, 1, days=30)
    make_folder(store.root / "refs")
    (store.root / "refs" / "mine.json").write_text(text)
    with pytest.raises(DamagedArtefactError, match="koop unpin mine"):
        plan(store, 0)
    assert read_all(store) == 1


def test_pinned_between_plan_and_removal(store):
    base = commit(store, 1, days=30)
    made = commit(store, 2, stage="simulate", of=base, days=30)
    gone = commit(store, 3, days=30)
    planned = plan(store, WEEK, delete=True)
    pin(store, "late", [made])
    assert [one.name for one in remove(store, planned)] == [gone.name]
    assert there(store) == {base.key, made.key}
    assert read_all(store) == 2
    planned = plan(store, 0, delete=True)
    (store.root / "refs" / "late.json").write_text("")
    assert remove(store, planned) == []


def test_a_pin_that_was_damaged_between_plan_and_removal_keeps_all(store):
    old = commit(store, 1, days=30)
    planned = plan(store, WEEK, delete=True)
    make_folder(store.root / "refs")
    (store.root / "refs" / "late.json").write_text("")
    assert remove(store, planned) == []
    assert there(store) == {old.key}


def test_a_record_that_was_replaced_between_plan_and_removal_stays(store):
    """By one of a newer koop, say, whose object is the same."""
    old = commit(store, 1, days=30)
    planned = plan(store, WEEK, delete=True)
    path = record_path(store, old)
    path.write_text(json.dumps({**json.loads(path.read_text()), "schema": SCHEMA + 1}))
    assert remove(store, planned) == []
    assert path.exists()
    assert store.path(old).exists()


def test_chunks_that_somebody_went_on_with_between_plan_and_removal_stay(store):
    for name in ("1" * 64, "2" * 64):
        store.parts(name).commit(0, packed())
        age(30, *(store.root / "partial" / name).iterdir())
    planned = plan(store, WEEK, delete=True)
    make_folder(store.root / "locks")
    with FileLock(store.root / "locks" / f"{'1' * 64}.lock"):
        assert [one.name for one in remove(store, planned)] == [f"partial/{'2' * 64}"]
    assert store.parts("1" * 64).read({0}).keys() == {0}
    assert not (store.root / "partial" / ("2" * 64)).exists()


def test_made_again_between_plan_and_removal(store):
    old = commit(store, 1, value=1.0, days=30)
    planned = plan(store, WEEK, delete=True)
    store.path(old).unlink()
    again = commit(store, 1, value=1.0)
    remove(store, planned)
    assert there(store) == {again.key}
    assert read_all(store) == 1


def orphaned(store, value=1.0):
    """The object of ``value`` without a record, old enough to go."""
    made = commit(store, 99, value=value, days=30)
    record_path(store, made).unlink()
    return store.path(made)


@pytest.mark.parametrize("when", ["before the scan", "after the scan"])
def test_committed_while_its_object_is_away(store, monkeypatch, when):
    """Another process commits equal content just when the orphan has been moved away."""
    path = orphaned(store)
    made = []
    real = collect.records

    def scan(root):
        assert not path.exists()
        if when == "before the scan":
            made.append(commit(Store(store.root), 1, value=1.0))
        found = real(root)
        if when == "after the scan":
            made.append(commit(Store(store.root), 1, value=1.0))
        return found

    monkeypatch.setattr(collect, "records", scan)
    collected(store)
    assert there(store) == {made[0].key}
    assert read_all(store) == 1
    assert [one.name for one in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("cut", [False, True])
def test_collected_between_an_object_and_its_record(store, monkeypatch, cut):
    """Another process has put its object, but no record yet, when the collection takes the object for an orphan."""

    class Slow(Store):
        def record(self, stage, key):
            path = orphan.with_name(orphan.name)
            age(30, path)
            if cut:
                with monkeypatch.context() as patch:
                    patch.setattr(collect, "records", interrupt)
                    with pytest.raises(KeyboardInterrupt):
                        collected(store)
                assert not path.exists()
            else:
                assert [one.kind for one in collected(store)] == ["orphan object"]
            return super().record(stage, key)

    def interrupt(root):
        raise KeyboardInterrupt

    orphan = orphaned(store)
    made = Slow(store.root).commit(recipe(1), {}, packed(1.0), {"time": "2026-01-01", "seconds": 0.0})
    assert there(store) == {made.key}
    assert read_all(store) == 1
    collected(store)
    assert [one.name for one in orphan.parent.iterdir()] == [orphan.name]
    assert read_all(store) == 1


def test_committed_between_plan_and_move(store):
    path = orphaned(store)
    planned = plan(store, WEEK, delete=True)
    made = store.commit(recipe(1), {}, packed(1.0), {"time": "2026-01-01", "seconds": 0.0})
    os.utime(path, (planned.removals[0].files[0].mtime,) * 2)  # as if it had not been written again
    assert remove(store, planned) == []
    assert there(store) == {made.key}
    assert read_all(store) == 1


def test_cut_off_after_the_move_the_next_one_puts_it_back(store, monkeypatch):
    made = commit(store, 1, value=1.0)
    path = store.path(made)
    aside = path.with_name(f"{path.name}.1-{'0' * 16}@elsewhere")
    path.rename(aside)
    other = commit(store, 2, value=2.0)
    left = store.path(other).with_name(f"{store.path(other).name}.1-{'0' * 16}@elsewhere")
    left.write_bytes(store.path(other).read_bytes())
    record_path(store, other).unlink()
    store.path(other).unlink()
    collected(store)
    assert read_all(store) == 1
    assert not aside.exists()
    assert not left.exists()


def test_committing_and_collecting_at_once_loses_nothing(store):
    """One process commits what another takes for an orphan, again and again, at every moment of each other's work."""
    for seed in range(6):
        orphaned(store, float(seed))
        failed = []

        def work(seed=seed, failed=failed):
            try:
                for i in range(3):
                    commit(Store(store.root), 10 * seed + i, value=float(seed))
            except Exception as error:
                failed.append(error)

        worker = threading.Thread(target=work)
        worker.start()
        while worker.is_alive():
            collected(store)
        worker.join()
        assert failed == []
        assert read_all(store) == 3 * (seed + 1)
