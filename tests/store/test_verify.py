"""Looking for damage without the stages: what is told of each file, and that looking changes nothing."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest

from koopcli.errors import StorageError
from koopcli.store import Store
from koopcli.store import store as store_module
from koopcli.store.identity import key_of
from koopcli.store.records import whole_recipe
from koopcli.store.survey import survey
from koopcli.store.verify import verify
from tests.store.test_store import commit


def kinds(report):
    return [one.kind for one in report.findings]


def look(record, packed):
    packed.arrays["x"].values[...]


def test_every_byte_of_an_object_is_guarded(store):
    record = commit(store)
    path = store.path(record)
    good = path.read_bytes()
    for where in range(0, len(good), 97):
        bad = bytearray(good)
        bad[where] ^= 1
        path.write_bytes(bad)
        (found,) = verify(store, look).findings
        assert (found.kind, found.name, found.path) == (
            "damaged object",
            record.name,
            path.relative_to(store.root).as_posix(),
        )
        assert found.damage
        assert verify(store, None).findings == ()
        assert path.read_bytes() == bad
    path.write_bytes(good)
    assert verify(store, look).findings == ()


def test_each_artefact_of_equal_content_is_named(store):
    one, two = commit(store, 1), commit(store, 2)
    store.path(one).unlink()
    report = verify(store, look)
    assert kinds(report) == ["missing object"] * 2
    assert {found.name for found in report.findings} == {one.name, two.name}
    assert report.checked == 2


def test_bytes_and_progress(store):
    for seed in range(3):
        commit(store, seed, value=float(seed))
    told = []
    report = verify(store, look, lambda done, total: told.append(done / total))
    assert report.read == sum(path.stat().st_size for path in (store.root / "objects").rglob("*.h5"))
    assert told[-1] == 1
    assert told == sorted(told)


def test_an_object_that_the_disk_cannot_give(store, monkeypatch):
    record = commit(store)
    real = store_module.open_regular

    def failing(code):
        def call(path, *args):
            if path == store.path(record):
                raise OSError(code, os.strerror(code))
            return real(path, *args)

        return call

    for code, kind in ((errno.EIO, "damaged object"), (errno.EACCES, "unreadable object")):
        monkeypatch.setattr(store_module, "open_regular", failing(code))
        assert kinds(verify(store, look)) == [kind]


def test_removed_while_we_look_is_no_damage(store):
    """A collection removes the record first, so what it removes meanwhile is not taken for damage."""
    commit(store, 1)
    second = commit(store, 2, value=2.0)

    def remove(record, packed):
        for path in (store.root / "records" / "sample" / f"{second.key}.json", store.path(second)):
            path.unlink(missing_ok=True)

    first = min(store.path(commit(store, 1)), store.path(second))
    if first == store.path(second):  # whichever is looked at first removes the other
        second = store.find(f"sample/{next(key for _, key in store.index() if key != second.key)}")
    assert verify(store, remove).findings == ()
    assert len(store.index()) == 1


def test_what_lies_where_folders_should(store, tmp_path):
    commit(store)
    (store.root / "refs").write_text("")
    (store.root / "partial").symlink_to(tmp_path)
    (store.root / "records" / "file").write_text("")
    (store.root / "records" / "Two words").mkdir()
    (store.root / "objects" / "file").write_text("")
    (store.root / "README.md").write_text("")
    report = verify(store, look)
    assert kinds(report) == ["foreign file"] * 5
    assert {one.path for one in report.findings} == {
        "refs",
        "partial",
        "records/file",
        "records/Two words",
        "objects/file",
    }


def test_a_record_that_is_a_link_or_nonsense(store, tmp_path):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert kinds(verify(store, look)) == ["damaged record"]
    path.unlink()
    for text in ("", "[]", "{" * 100_000, "[" * 100_000, json.dumps({"schema": "x"})):
        path.write_text(text)
        assert kinds(verify(store, look)) == ["damaged record"]
    assert not (store.root / "quarantine").exists()


def test_a_record_that_was_put_aside_is_lost_until_another_has_its_name(store):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    good = path.read_text()
    for number in range(3):  # the third time nothing is left of the recipe
        path.write_text(good.replace('"check"', '"Check"') if number < 2 else good.replace('"width"', '"Width"'))
        assert store.record("sample", record.key) is None
    names = {f"{record.key}.json", f"{record.key}.json.1", f"{record.key}.json.2"}
    assert {aside.name for aside in (store.root / "quarantine").iterdir()} == names
    (lost,) = verify(store, look).findings
    assert (lost.kind, lost.artefact, lost.damage) == ("record put aside", f"sample/{record.key}", True)
    assert "--repair makes it again" in lost.what
    path.write_text("{")
    assert kinds(verify(store, look)) == ["damaged record", "record put aside"]
    path.write_text(good)
    assert verify(store, look).findings == ()
    path.unlink()
    for name in names:
        (store.root / "quarantine" / name).unlink()
    assert kinds(verify(store, look)) == ["orphan object"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"recipe": 3}',
        '{"recipe": {"stage": "sample", "version": 1, "settings": {}, "inputs": {"of": "x"}}}',
        '{"recipe": {"stage": "../x", "version": 1, "settings": {}, "inputs": {}}}',
    ],
)
def test_a_record_in_quarantine_without_a_recipe_is_lost_until_its_file_is_gone(store, text):
    recipe = json.loads(text or "{}")
    key = key_of(recipe["recipe"]) if "recipe" in recipe else "0" * 64
    quarantine = store.root / "quarantine"
    quarantine.mkdir(parents=True)
    (quarantine / f"{key}.json").write_text(text)
    os.mkfifo(quarantine / f"{'1' * 64}.json")
    (quarantine / f"{'2' * 64}.h5").write_text("")
    (quarantine / f"{key}.json.given-up").write_text("")
    report = verify(store, look)
    assert report.quarantine == 4
    assert {(one.kind, one.path, one.damage) for one in report.findings} == {
        ("record put aside", f"quarantine/{name}.json", True) for name in (key, "1" * 64)
    }
    for finding in report.findings:
        assert "run its command afresh; remove the file" in finding.what
        (store.root / finding.path).unlink()
    assert verify(store, look).findings == ()


@pytest.mark.parametrize("keep", [0, 30, 400])
def test_a_record_that_was_put_aside_cut_off(store, keep):
    """As long as its recipe is whole it can be made again; otherwise it is lost until it is made by its command."""
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    path.write_bytes(path.read_bytes()[:keep])
    assert store.record("sample", record.key) is None
    assert not path.exists()
    (finding,) = [one for one in verify(store, look).findings if one.damage]
    assert finding.kind == "record put aside"
    assert finding.artefact == (f"sample/{record.key}" if keep == 400 else "")
    assert ("is whole" in finding.what) == (keep == 400)
    commit(store)
    assert verify(store, look).findings == ()


@pytest.mark.parametrize("text", ['{"recipe": ', "{'recipe': {", '{"recipe": ' + "[" * 100_000, '"recipe": {"stage"'])
def test_texts_that_are_cut_off_within_a_recipe(text):
    assert whole_recipe(text.encode(), "0" * 64) is None


def test_a_recipe_is_read_from_a_text_that_is_cut_off_anywhere_behind_it(store):
    record = commit(store)
    path = store.root / "records" / "sample" / f"{record.key}.json"
    text = path.read_bytes().replace(b"2026", "\u2026".encode())
    behind = text.index(b'"lineage"') - 3
    assert {whole_recipe(text[:end], record.key) is not None for end in range(behind, len(text))} == {True}
    assert {whole_recipe(text[:end], record.key) is not None for end in range(behind)} == {False}
    assert whole_recipe(text[:behind].replace(b"width", b"Width"), record.key) is None


def test_the_survey_of_nothing(tmp_path):
    found = survey(tmp_path / "none")
    assert not any(vars(found).values())
    assert found.newest() == 0


def test_putting_aside_where_nothing_can_be_written(store, monkeypatch):
    record = commit(store)

    def refuse(*args, **kwargs):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(StorageError, match="make the store writable"):
        Store(store.root).put_aside(Path(store.path(record)))
