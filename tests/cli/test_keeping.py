"""verify, gc, and what ls and show say of the state of a store."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
from pathlib import Path

import pytest
from filelock import FileLock

from tests.cli.test_errors import one_line
from tests.conftest import read_all
from tests.large import large_from
from tests.store.test_store import make_older

DAY = 86400


def tree(root: Path) -> dict[str, str]:
    """Every file and folder below ``root`` with its content and its time."""
    return {
        str(path.relative_to(root)): (
            "folder" if path.is_dir() else hashlib.sha256(path.read_bytes()).hexdigest() + str(path.stat().st_mtime_ns)
        )
        for path in sorted(root.rglob("*"))
    }


def flip(path: Path, where: int = 600) -> None:
    content = bytearray(path.read_bytes())
    content[where] ^= 1
    path.write_bytes(content)


def findings(result) -> list[dict]:
    return json.loads(result.out)["findings"]


@pytest.fixture
def made(koop, folder):
    """A predictor and all behind it; the files of each stage's record and object."""
    assert koop("fit-edmd").code == 0
    return files(folder)


def files(folder):
    found = {}
    for path in (folder / "artefacts" / "records").glob("*/*.json"):
        digest = json.loads(path.read_text())["object"]
        found[path.parent.name] = (path, folder / "artefacts" / "objects" / digest[:2] / f"{digest}.h5")
    return found


def damage(kind: str, made, root: Path) -> None:
    record, content = made["fit-edmd"]
    if kind == "damaged record":
        record.write_text(record.read_text().replace('"seconds"', '"Seconds"'))
    elif kind == "damaged object":
        flip(content)
    elif kind == "truncated object":
        content.write_bytes(content.read_bytes()[:-1])
    elif kind == "missing object":
        content.unlink()
    elif kind == "link for object":
        shutil.move(content, root.parent / "elsewhere.h5")
        content.symlink_to(root.parent / "elsewhere.h5")
    elif kind == "damaged orphan":
        (root / "objects" / "aa").mkdir()
        (root / "objects" / "aa" / f"{'a' * 64}.h5").write_bytes(b"x")
    elif kind == "damaged input":
        flip(made["simulate"][1])
        made["simulate"][0].write_text(made["simulate"][0].read_text().replace('"argv"', '"Argv"'))
        content.unlink()


DAMAGE = {
    "damaged record": {"damaged record"},
    "damaged object": {"damaged object"},
    "truncated object": {"damaged object"},
    "missing object": {"missing object"},
    "link for object": {"damaged object"},
    "damaged orphan": {"damaged object"},
    "damaged input": {"damaged record", "damaged object", "missing object"},
}


def test_a_whole_store(koop, folder, made):
    before = tree(folder)
    done = koop("verify")
    assert done.code == 0
    assert re.fullmatch(r"3 artefacts, .* read: nothing is damaged\n", done.out)
    found = json.loads(koop("verify", "--json").out)
    assert found["checked"] == 3
    assert found["findings"] == []
    assert found["bytes"] == sum(content.stat().st_size for _, content in made.values())
    assert json.loads(koop("verify", "--fast", "--json").out)["bytes"] == 0
    assert koop("verify", "--repair").code == 0
    assert tree(folder) == before


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_found_without_a_touch_and_repaired(koop, folder, made, kind):
    root = folder / "artefacts"
    digests = {name: json.loads(record.read_text())["data"] for name, (record, _) in made.items()}
    damage(kind, made, root)
    before = tree(root)
    found = koop("verify", "--json")
    assert found.code == 5
    assert "koop verify --repair" in found.err.splitlines()[-1]
    assert {one["kind"] for one in findings(found)} == DAMAGE[kind]
    assert not any(one["repaired"] for one in findings(found))
    table = koop("verify")
    assert table.code == 5
    assert findings(found)[0]["path"] in table.out
    assert tree(root) == before
    mended = koop("verify", "--repair", "--json")
    assert mended.code == 0, mended.err
    assert all(one["repaired"] for one in findings(mended) if one["damage"])
    assert json.loads(mended.out)["damaged"] == 0
    if "missing" not in kind:
        assert list((root / "quarantine").iterdir())
    again = koop("verify", "--json")
    assert again.code == 0
    assert findings(again) == []
    assert read_all(root) == 3
    assert {name: json.loads(record.read_text())["data"] for name, (record, _) in files(folder).items()} == digests


def test_records_that_a_command_put_aside_are_repaired(koop, folder, made):
    """`koop ls` moves damaged records away, with the recipes that a repair needs."""
    root = folder / "artefacts"
    names = {row["name"] for row in json.loads(koop("ls", "--json").out)}
    for record, _ in made.values():
        record.write_text(record.read_text().replace('"check": "', '"check": "0'))
    assert koop("ls").err.count("put aside") == 3
    assert not list((root / "records").rglob("*.json"))
    for options in ([], ["--fast"]):
        found = koop("verify", "--json", *options)
        assert found.code == 5
        lost = [one for one in findings(found) if one["damage"]]
        assert [one["kind"] for one in lost] == ["record put aside"] * 3
        assert {one["name"] for one in lost} == names
        assert all(one["path"].startswith("quarantine/") for one in lost)
    mended = koop("verify", "--repair")
    assert mended.code == 0
    assert "3 repaired" in mended.out
    assert koop("verify").code == 0
    assert read_all(root) == 3
    assert len(list((root / "quarantine").iterdir())) == 3


def test_records_that_are_cut_off_are_repaired_from_the_recipes_in_them(koop, folder, made):
    root = folder / "artefacts"
    for record, _ in made.values():
        text = record.read_bytes()
        record.write_bytes(text[: text.index(b'"lineage"')])
    assert koop("verify", "--json").code == 5
    assert koop("ls").err.count("put aside") == 3
    told = koop("verify", "--json")
    assert told.code == 5
    assert [one["kind"] for one in findings(told) if one["damage"]] == ["record put aside"] * 3
    assert json.loads(koop("verify", "--repair", "--json").out)["damaged"] == 0
    assert koop("verify").code == 0
    assert read_all(root) == 3


@pytest.mark.parametrize("options", [[], ["--fast"]])
def test_digests_of_slabs_are_written_anew_and_the_artefact_only_with_its_object(koop, folder, options):
    with large_from(1000):
        assert koop("fit-edmd").code == 0
        made = files(folder)
        slabs = {stage: content.with_suffix(".slabs") for stage, (_, content) in made.items()}
        slabs["simulate"].unlink()
        slabs["sample"].write_bytes(b"x")
        flip(made["sample"][1])
        assert koop("ls").out.count("missing") == 1
        told = koop("verify", "--json", *options)
        assert told.code == 5
        kinds = {(one["kind"], one["path"].partition("/")[2]) for one in findings(told)}
        assert {kind for kind, path in kinds if path.endswith(".slabs")} == {"missing digests", "damaged digests"}
        mended = koop("verify", "--repair", *options)
        assert mended.code == 0
        assert "simulate" not in "".join(line for line in mended.err.splitlines() if "made in" in line)
        assert koop("verify").code == 0
        assert read_all(folder / "artefacts") == 3


def test_a_repair_that_was_cut_off_goes_on(koop, made, monkeypatch):
    from koopcli.stages.pipeline import Pipeline

    made["fit-edmd"][0].write_text(made["fit-edmd"][0].read_text().replace('"check": "', '"check": "0'))

    def cut_off(*args):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Pipeline, "make", cut_off)
        assert koop("verify", "--repair").code == 130
    assert not made["fit-edmd"][0].exists()
    assert "1 repaired" in koop("verify", "--repair").out
    assert made["fit-edmd"][0].exists()


@pytest.mark.parametrize("order", [("records", "objects"), ("objects", "records")])
@pytest.mark.parametrize("whole", [1, 4])
def test_a_store_whose_copying_was_cut_off(koop, folder, made, order, whole):
    """What is whole is served, what is missing is named, and can be made again."""
    source, copy = folder / "artefacts", folder / "copy"
    to_copy = [file for part in order for file in sorted((source / part).rglob("*.*"))]
    for number, file in enumerate(to_copy[: whole + 1]):
        target = copy / file.relative_to(source)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(file.read_bytes() if number < whole else file.read_bytes()[: file.stat().st_size // 2])
    complete = {
        f"{stage}/{record.stem[:12]}"
        for stage, (record, content) in made.items()
        if {record, content} <= set(to_copy[:whole])
    }
    recorded = {f"{file.parent.name}/{file.stem[:12]}" for file in to_copy[: whole + 1] if file.suffix == ".json"}
    for options in ([], ["--fast"]):
        report = koop("verify", "--json", "--store", "copy", *options)
        assert {one["name"] for one in findings(report) if one["damage"]} - {""} == recorded - complete
        named = {one["path"] for one in findings(report)}
        if not options or order[0] == "records":
            assert str(to_copy[whole].relative_to(source)) in named
            assert report.code == 5
    for name in complete:
        shown = koop("show", name, "--store", "copy")
        assert shown.code == 0
        assert "made in" not in shown.err
    again = koop("fit-edmd", "--store", "copy")
    assert again.name == f"fit-edmd/{made['fit-edmd'][0].stem[:12]}"
    assert koop("verify", "--repair", "--store", "copy").code == 0
    assert koop("verify", "--store", "copy").code == 0
    assert read_all(copy) == 3


def test_what_the_fast_check_sees(koop, made):
    flip(made["sample"][1])
    assert koop("verify", "--fast").code == 0
    made["simulate"][1].unlink()
    made["fit-edmd"][1].write_bytes(b"")
    found = koop("verify", "--fast", "--json")
    assert found.code == 5
    assert sorted(one["kind"] for one in findings(found)) == ["damaged object", "missing object"]
    one_line(koop("verify", "--fast", "--full"), 2, "choose one")
    assert koop("verify", "--repair").code == 0


def test_what_cannot_be_repaired_stays_in_the_list(koop, folder, made):
    made["simulate"][0].unlink()
    flip(made["fit-edmd"][1])
    mended = koop("verify", "--repair")
    assert mended.code == 5
    assert "1 cannot be repaired" in mended.err.splitlines()[-1]
    assert "cannot be made again" in mended.err
    again = koop("verify", "--json")
    assert again.code == 5
    kinds = {one["kind"] for one in findings(again)}
    assert kinds == {"missing object", "input gone", "orphan object"}
    record = made["fit-edmd"][0]
    record.write_text(record.read_text().replace('"order": 2', '"order": 3'))  # not even its recipe is known
    assert koop("verify", "--repair").code == 5
    assert not record.exists()
    aside = folder / "artefacts" / "quarantine" / record.name
    text = aside.read_bytes()
    (lost,) = [one for one in findings(koop("verify", "--json")) if one["damage"]]
    assert (lost["kind"], lost["name"]) == ("record put aside", f"fit-edmd/{record.stem[:12]}")
    assert "run its command afresh" in lost["what"]
    assert koop("verify", "--repair").code == 5
    aside.unlink()
    assert koop("verify").code == 0
    aside.write_bytes(text)
    assert koop("verify").code == 5
    assert koop("fit-edmd").name == lost["name"]  # made again, it is no longer lost
    assert koop("verify").code == 0


def test_a_record_that_unpacks_no_more(koop, made, monkeypatch):
    from dataclasses import replace

    from koopcli.stages.registry import STAGES

    def refuse(packed):
        raise KeyError("matrix")

    stage = STAGES["fit-edmd"]
    monkeypatch.setitem(STAGES, "fit-edmd", replace(stage, unpack=refuse, version=stage.version + 1))
    other = koop("verify", "--json")
    assert other.code == 0
    assert [one["kind"] for one in findings(other)] == ["other version"]
    monkeypatch.setitem(STAGES, "fit-edmd", replace(stage, unpack=refuse))
    assert [one["kind"] for one in findings(koop("verify", "--json"))] == ["damaged object"]
    assert koop("verify", "--repair").code == 5
    assert made["fit-edmd"][1].exists()  # its bytes are right: who has the right code can read it
    monkeypatch.delitem(STAGES, "fit-edmd")
    assert [one["kind"] for one in findings(koop("verify", "--json"))] == ["newer format"]


def test_a_store_of_the_format_before(koop, folder, made):
    root = folder / "artefacts"
    for record, _ in made.values():
        make_older(record)
    before = tree(root)
    for options in ([], ["--fast"], ["--repair"]):
        told = koop("verify", "--json", *options)
        assert told.code == 8
        assert [one["kind"] for one in findings(told)] == ["older format"] * 3
        assert all("make it again by the same command" in one["what"] for one in findings(told))
        assert not any(one["damage"] for one in findings(told))
    shown = koop("verify")
    assert shown.out.splitlines()[-1].endswith("read: nothing is damaged; 3 of another format")
    assert "none of the 3 artefacts has the format" in shown.err.splitlines()[-1]
    listed = koop("ls")
    assert listed.code == 0
    assert [line for line in listed.err.splitlines() if "format" in line] == [
        "warning: not listed: 3 of an older format; make them again by the same commands"
    ]
    one_line(koop("show", f"sample/{made['sample'][0].stem}"), 8, "written by an older koop")
    assert tree(root) == before
    (root / "objects" / "aa").mkdir(exist_ok=True)
    (root / "objects" / "aa" / f"{'a' * 64}.slabs").write_bytes(b"")
    assert {one["kind"] for one in findings(koop("verify", "--json"))} == {"older format"}
    made["sample"][0].write_text("{")  # damage comes first
    assert koop("verify").code == 5


def test_records_of_the_format_before_beside_others(koop, made):
    make_older(made["fit-edmd"][0])
    told = koop("verify", "--json")
    assert told.code == 0
    assert json.loads(told.out)["checked"] == 2
    assert json.loads(told.out)["other_format"] == 1
    assert [one["kind"] for one in findings(told)] == ["older format"]
    assert koop("ls").err.count("format") == 1


def test_a_kind_that_this_koop_lacks_is_no_damage(koop, folder, made):
    from koopcli.records import Packed
    from koopcli.store import Store

    store = Store(folder / "artefacts")
    record = store.find("fit-edmd")
    packed = store.read(record)
    meta = {**packed.meta, "dynamics": {**packed.meta["dynamics"], "kind": "wavelets"}}
    recipe = {**record.recipe, "settings": {"terms": {"kind": "wavelets"}}}
    newer = store.commit(recipe, record.lineage, Packed(packed.arrays, meta), {"time": "", "seconds": 0.0})
    for options in ([], ["--repair"]):
        told = koop("verify", "--json", *options)
        assert told.code == 0
        assert [(one["kind"], one["name"]) for one in findings(told)] == [("newer format", newer.name)]
    assert store.path(newer).exists()


def test_what_is_no_damage_is_told_and_left_alone(koop, folder, made):
    root = folder / "artefacts"
    other = koop("sample", "--seed", "9").name
    (newer,) = (path for path in (root / "records" / "sample").iterdir() if path.stem.startswith(other[7:]))
    newer.write_text(json.dumps({**json.loads(newer.read_text()), "schema": 99}))
    (root / "objects" / "notes.txt").write_text("")
    (root / "stray").mkdir()
    (root / "records" / "sample" / f"{'0' * 64}.json").mkdir()
    (root / "partial" / ("1" * 64)).mkdir(parents=True)
    (root / "partial" / ("1" * 64) / f"0-{'2' * 64}.h5").write_text("")
    finished = root / "partial" / made["simulate"][0].stem
    finished.mkdir()
    (finished / f"0-{'2' * 64}.h5").write_text("")
    litter = root / "tmp" / f"4194304-{'0' * 16}@somewhere"
    litter.write_text("")
    os.utime(litter, (1, 1))
    before = tree(root)
    result = koop("verify", "--repair", "--json")
    assert result.code == 0
    assert {(one["kind"], one["path"]) for one in findings(result)} == {
        ("newer format", str(newer.relative_to(root))),
        ("foreign file", "objects/notes.txt"),
        ("foreign file", "stray"),
        ("foreign file", f"records/sample/{'0' * 64}.json"),
        ("orphan chunks", str(finished.relative_to(root))),
        ("temporary file", str(litter.relative_to(root))),
    }
    assert json.loads(result.out)["unfinished"] == 2
    assert tree(root) == before


def test_pins(koop, folder, made):
    name = koop("fit-edmd").name
    koop("pin", name)
    (pin,) = (folder / "artefacts" / "refs").iterdir()
    made["fit-edmd"][0].unlink()
    gone = koop("verify", "--json")
    assert gone.code == 5
    assert {one["kind"] for one in findings(gone)} == {"pin of nothing", "orphan object"}
    koop("fit-edmd")
    assert koop("verify").code == 0
    pin.write_text(pin.read_text()[:-3])
    assert [one["kind"] for one in findings(koop("verify", "--repair", "--json"))] == ["damaged pin"]
    assert pin.exists()  # what it kept would look unwanted without it
    one_line(koop("gc", "--grace", "0", "--delete"), 5, f"koop unpin {pin.stem}")
    one_line(koop("gc"), 5, "nothing is removed")
    assert read_all(folder / "artefacts") == 3
    koop("unpin", pin.stem)
    assert koop("verify").code == 0


def test_nothing_there(koop, folder):
    for command in (["verify"], ["gc"], ["gc", "--delete"], ["ls", "--stale"]):
        assert koop(*command).code == 0
        assert not (folder / "artefacts").exists()
    assert json.loads(koop("gc", "--json").out) == {"remove": [], "bytes": 0, "kept": 0, "deleted": False}
    one_line(koop("show", "--lineage", "abc"), 4, "koop ls")
    (folder / "artefacts").mkdir()
    assert koop("gc", "--delete").code == 0
    assert koop("verify").code == 0
    assert list((folder / "artefacts").iterdir()) == []


@pytest.mark.parametrize("grace", ["-1", "nan", "inf"])
def test_a_grace_that_is_none(koop, grace):
    one_line(koop("gc", "--grace", grace), 3, "--grace must be a number of days")


def test_collecting_says_first_and_does_when_told(koop, folder, made):
    root = folder / "artefacts"
    young = koop("gc")
    assert "artefacts kept: 3" in young.out
    other = koop("fit-edmd", "--order", "1").name
    koop("pin", other)
    before = {path: text for path, text in tree(root).items() if path != "tmp"}
    planned = json.loads(koop("gc", "--grace", "0", "--json").out)
    assert {path: text for path, text in tree(root).items() if path != "tmp"} == before
    record, content = made["fit-edmd"]
    assert planned == {
        "remove": [
            {
                "kind": "artefact",
                "name": f"fit-edmd/{record.stem[:12]}",
                "bytes": record.stat().st_size + content.stat().st_size,
            }
        ],
        "bytes": record.stat().st_size + content.stat().st_size,
        "kept": 3,
        "deleted": False,
    }
    told = koop("gc", "--grace", "0")
    assert f"fit-edmd/{record.stem[:12]}" in told.out
    assert "koop gc --delete" in told.err
    assert json.loads(koop("gc", "--grace", "0", "--delete", "--json").out) == {**planned, "deleted": True}
    assert not record.exists()
    assert not content.exists()
    assert read_all(root) == 3
    assert koop("verify").code == 0


def test_a_read_only_store_can_be_looked_at(koop, folder, made, monkeypatch):
    name = koop("fit-edmd").name
    before = tree(folder)

    def refuse(*args, **kwargs):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    real = os.open
    monkeypatch.setattr(os, "open", lambda p, f, *a, **k: refuse() if f & os.O_CREAT else real(p, f, *a, **k))
    for call in ("replace", "mkdir", "write", "fsync", "utime"):
        monkeypatch.setattr(os, call, refuse)
    assert koop("verify").code == 0
    assert koop("show", "--lineage", name).code == 0
    assert koop("ls", "--stale").code == 0
    assert koop("diff", name, name).code == 0
    counted = koop("gc", "--grace", "0")
    assert counted.code == 0
    assert "newest file" in counted.err
    one_line(koop("gc", "--grace", "0", "--delete"), 6, "Read-only")
    flip(made["fit-edmd"][1])
    one_line_of = koop("verify", "--repair")
    assert one_line_of.code == 6
    flip(made["fit-edmd"][1])
    assert {k: v[:64] for k, v in tree(folder).items()} == {k: v[:64] for k, v in before.items()}


def test_a_lineage(koop, folder, made):
    name = koop("evaluate").name
    gone = made["sample"][0]
    made["simulate"][1].unlink()
    gone.unlink()
    before = tree(folder)
    shown = koop("show", "--lineage", name)
    assert shown.code == 0
    lines = shown.out.splitlines()
    assert lines[0].startswith(f"{name}  ")
    assert any("predictor: fit-edmd/" in line and "order=2" in line for line in lines)
    assert any(re.search(r"trajectories: simulate/\w+  missing", line) for line in lines)
    assert any(f"sample: sample/{gone.stem[:12]}  gone" in line for line in lines)
    found = json.loads(koop("show", "--lineage", "--json", name).out)
    assert found["name"] == name
    trajectories = found["inputs"]["predictor"]["inputs"]["trajectories"]
    assert trajectories["state"] == "missing"
    assert trajectories["inputs"]["sample"] == {
        "name": f"sample/{gone.stem[:12]}",
        "state": "gone",
        "inputs": {},
    }
    assert found["inputs"]["trajectories"]["inputs"]["sample"]["settings"]["kind"] == "box"
    assert tree(folder) == before
    one_line(koop("show", "--lineage", "--csv", name), 2, "choose one")


def test_chunks_that_somebody_works_on_stay(koop, folder, made):
    root = folder / "artefacts"
    for key in ("1" * 64, "2" * 64):
        (root / "partial" / key).mkdir(parents=True)
        chunk = root / "partial" / key / f"0-{'3' * 64}.h5"
        chunk.write_text("")
        os.utime(chunk, (1, 1))
    with FileLock(root / "locks" / f"{'1' * 64}.lock"):
        would = json.loads(koop("gc", "--json").out)["remove"]
        removed = json.loads(koop("gc", "--delete", "--json").out)["remove"]
    assert would == removed
    assert [one["name"] for one in removed if one["kind"] == "chunks"] == [f"partial/{'2' * 64}"]
    assert [path.name for path in (root / "partial").iterdir()] == ["1" * 64]


def test_mended_by_another_process_meanwhile(folder, made, monkeypatch):
    """What was damaged when it was looked at, but is no longer, is not put aside."""
    from koopcli.console import Console
    from koopcli.stages.repair import opens, repair
    from koopcli.store import Store
    from koopcli.store.verify import verify

    record, content = made["fit-edmd"]
    good = record.read_bytes(), content.read_bytes()
    flip(content)
    store = Store(folder / "artefacts")
    found = verify(store, opens).findings
    record.write_text("{}")
    found += tuple(one for one in verify(store, opens).findings if one.kind == "damaged record")
    record.write_bytes(good[0])
    content.write_bytes(good[1])
    mended = repair(store, Console(), found)
    assert [one.kind for one in mended] == ["damaged object", "damaged record"]
    assert mended[0].repaired
    assert not (folder / "artefacts" / "quarantine").exists()


def test_texts_from_records_do_not_steer_the_terminal(koop, folder, made):
    from koopcli.store import Store

    store = Store(folder / "artefacts")
    record = store.find("fit-edmd")
    recipe = {**record.recipe, "settings": {**record.recipe["settings"], "basis": "\x1b[31mred\x9b"}}
    nasty = store.commit(recipe, record.lineage, store.read(record), record.provenance).name
    for command in (["ls"], ["ls", "--stale"], ["show", "--lineage", nasty], ["diff", record.name, nasty]):
        shown = koop(*command)
        assert shown.code == 0, shown.err
        assert "red" in shown.out
        assert "\x1b" not in shown.out
        assert "\x9b" not in shown.out
