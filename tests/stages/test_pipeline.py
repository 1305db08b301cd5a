from __future__ import annotations

import errno
import os
from contextlib import contextmanager
from dataclasses import replace

import h5py
import numpy as np
import pytest

import koopcli
from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.errors import DamagedArtefactError, NewerFormatError, UnknownNameError
from koopcli.koopman.scores import evaluation
from koopcli.progress import silent
from koopcli.records import Array, Packed
from koopcli.stages import read, recipes
from koopcli.stages.chunks import Chunk, commit
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.registry import STAGES
from koopcli.store import Store
from koopcli.store.code import code_digest
from koopcli.vehicles.plants.forces import Forces
from tests.large import large_from
from tests.powercut.recorder import Events, recording

SMALL = ["sample.count=5", "sample.columns=2", "fit-edmd.order=2", "test.count=40", "test.steps=5", "evaluate.chunk=10"]


class Listener:
    """A reporter that remembers."""

    def __init__(self):
        self.notes, self.warnings = [], []

    def note(self, text):
        self.notes.append(text)

    def warn(self, text):
        self.warnings.append(text)

    @contextmanager
    def progress(self, label):
        yield silent

    def made(self):
        return [note.partition("/")[0] for note in self.notes if " made in " in note]


def experiment(*assignments):
    return load_experiment("paper", parse_set([*SMALL, *assignments]))


@pytest.fixture
def fresh(store):
    """A new pipeline on the same store, as a new process would have."""

    def make():
        listener = Listener()
        return Pipeline(Store(store.root, listener.warn), listener), listener

    return make


def test_made_once_and_found_again(fresh):
    line, heard = fresh()
    made = line.make(recipes.evaluation(experiment()))
    assert heard.made() == ["sample", "simulate", "fit-edmd", "sample", "simulate", "evaluate"]
    assert not made.cached
    line, heard = fresh()
    found = line.make(recipes.evaluation(experiment()))
    assert found.cached
    assert found.record == made.record
    assert heard.notes == [f"{made.record.name:<24} reused"]
    assert found.figures == made.figures


def test_a_change_upstream_makes_only_what_depends_on_it(fresh):
    fresh()[0].make(recipes.evaluation(experiment()))
    line, heard = fresh()
    line.make(recipes.evaluation(experiment("fit-edmd.order=1")))
    assert heard.made() == ["fit-edmd", "evaluate"]
    line, heard = fresh()
    line.make(recipes.evaluation(experiment("vehicle.Jzz=1731")))
    assert heard.made() == ["simulate", "fit-edmd", "simulate", "evaluate"]


def test_names_and_paths_are_not_part_of_a_recipe(fresh, tmp_path):
    from koopcli.config.data import data_folder

    one = fresh()[0].make(recipes.simulation(experiment()))
    copy = tmp_path / "the-same.toml"
    copy.write_text((data_folder() / "vehicles" / "ctu-2020.toml").read_text())
    two = fresh()[0].make(recipes.simulation(experiment(f"vehicle.name={copy}")))
    assert two.cached
    assert two.record == one.record


def test_a_hit_writes_nothing_and_needs_nothing_upstream(fresh, store):
    made = fresh()[0].make(recipes.evaluation(experiment()))
    for upstream in ("sample", "simulate", "fit-edmd"):
        for stage, key in store.index():
            if stage == upstream:
                store.path(store.record(stage, key)).unlink(missing_ok=True)
    before = {path: path.stat().st_mtime_ns for path in store.root.rglob("*")}
    assert fresh()[0].make(recipes.evaluation(experiment())).record == made.record
    assert {path: path.stat().st_mtime_ns for path in store.root.rglob("*")} == before


def test_a_hit_is_synced_before_it_is_announced(fresh, store):
    """Who made it may have been killed before that."""
    made = fresh()[0].make(recipes.fit_edmd(experiment())).record
    line, heard = fresh()
    events = Events()
    with recording(store.root, events):
        heard.note = lambda text: events.add(("say", text))
        line.make(recipes.fit_edmd(experiment()))
    assert events[-2:] == [("sync", str(store.root / "records" / "fit-edmd")), ("say", f"{made.name:<24} reused")]


def test_a_hit_that_cannot_be_synced_is_served(fresh, monkeypatch):
    made = fresh()[0].make(recipes.fit_edmd(experiment()))

    def refuse(*args):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "fsync", refuse)
    assert fresh()[0].make(recipes.fit_edmd(experiment())).record == made.record


def damage(store, record):
    """One wrong byte in the values of the object of ``record``."""
    path = store.path(record)
    content = bytearray(path.read_bytes())
    content[-100] ^= 1
    path.write_bytes(content)


@pytest.fixture
def on_disk():
    with large_from(0):
        yield


def test_damage_that_a_stage_meets_while_it_reads_is_made_again(fresh, store, on_disk):
    pipeline, _ = fresh()
    task = recipes.fit_edmd(experiment())
    trajectories = pipeline.make(task.input("trajectories")).record
    damage(store, trajectories)
    pipeline, heard = fresh()
    made = pipeline.make(task)
    assert store.has_object(trajectories)
    (warning,) = heard.warnings
    assert warning.startswith(f"the object of {trajectories.name} is damaged and was put aside")
    assert warning.endswith("making it again")
    assert made.figures["functions"] == 27


def test_damage_that_a_worker_meets_leaves_the_chunk_to_the_command(fresh, store, on_disk):
    pipeline, _ = fresh()
    task = recipes.evaluation(experiment())
    inputs = {role: pipeline.make(upstream).record for role, upstream in task.inputs}
    lineage = tuple((role, f"{record.stage}/{record.key}") for role, record in inputs.items())
    chunk = Chunk(store.root, "evaluate", task.settings, "0" * 64, lineage, 1, 10, 20, code=code_digest())
    assert commit(chunk) == []
    assert store.parts("0" * 64).read([1])
    damage(store, inputs["trajectories"])
    assert commit(replace(chunk, i=2)) == []  # what this process has read stays good
    assert commit(replace(chunk, i=3, start=30, stop=40)) == []
    assert list(store.parts("0" * 64).read([1, 2, 3])) == [1, 2]


def test_a_damaged_object_is_put_aside_and_made_again(fresh, store):
    made = fresh()[0].make(recipes.fit_edmd(experiment()))
    path = store.path(made.record)
    good = path.read_bytes()
    path.write_bytes(good[:-1] + bytes([good[-1] ^ 1]))
    line, heard = fresh()
    again = line.make(recipes.evaluation(experiment()))
    assert any("damaged and was put aside" in text for text in heard.warnings)
    assert path.read_bytes() == good
    assert list((store.root / "quarantine").iterdir())
    assert not again.cached


def test_a_named_artefact_is_rebuilt_from_its_recipe_or_refused(fresh, store):
    made = fresh()[0].make(recipes.fit_edmd(experiment()))
    store.path(made.record).write_bytes(b"")
    line, heard = fresh()
    assert line.make(line.named(made.record.name)).record.key == made.record.key
    assert heard.made() == ["fit-edmd"]
    store.path(made.record).write_bytes(b"")
    (path,) = (store.root / "records" / "simulate").glob("*.json")
    path.unlink()
    line, _ = fresh()
    with pytest.raises(DamagedArtefactError, match="cannot be made again"):
        line.make(line.named(made.record.name))


def test_a_named_artefact_of_an_older_version_is_used_as_it_is(fresh, store, monkeypatch):
    made = fresh()[0].make(recipes.fit_edmd(experiment()))
    monkeypatch.setitem(STAGES, "fit-edmd", replace(STAGES["fit-edmd"], version=99))
    line, heard = fresh()
    line.make(recipes.evaluation(experiment(), line.named(made.record.name)))
    assert "fit-edmd" not in heard.made()
    line, heard = fresh()
    line.make(recipes.fit_edmd(experiment()))
    assert heard.made() == ["fit-edmd"]
    store.path(made.record).write_bytes(b"")
    line, _ = fresh()
    with pytest.raises(DamagedArtefactError, match="another version"):
        line.make(line.named(made.record.name))


def test_a_predictor_stands_on_its_own(fresh, store):
    """With its trajectories gone from the store it still knows plant, vehicle and period for its test set."""
    made = fresh()[0].make(recipes.fit_edmd(experiment("vehicle.Jzz=1731", "simulate.dt=0.02")))
    (path,) = (store.root / "records" / "simulate").glob("*.json")
    path.unlink()
    line, _ = fresh()
    named = line.named(made.record.name)
    with pytest.raises(UnknownNameError, match="simulate stage behind"):
        named.ancestor("simulate")
    content = line.make(named).content
    plant = recipes.remembered_simulation(content.plant, content.dt)
    assert (plant.vehicle.Jzz, plant.dt, plant.plant) == (1731.0, 0.02, Forces())
    assert (
        line.make(recipes.evaluation(experiment(), named, recipes.test_set(experiment(), plant))).figures["steps"] == 5
    )


def test_a_rebuilt_input_that_differs_in_its_last_bits_changes_no_name(fresh, store, monkeypatch):
    """What another machine rounds differently must not come back under the old name."""
    made = fresh()[0].make(recipes.evaluation(experiment()))
    for stage in ("fit-edmd", "evaluate"):
        (record,) = [store.record(s, k) for s, k in store.index() if s == stage]
        store.path(record).unlink()
    real = STAGES["fit-edmd"]

    def elsewhere(*args):
        predictor = real.run(*args)
        linear = predictor.dynamics
        return replace(predictor, dynamics=replace(linear, A=linear.A * (1 + 1e-15)))

    monkeypatch.setitem(STAGES, "fit-edmd", replace(real, run=elsewhere))
    line, heard = fresh()
    with pytest.raises(DamagedArtefactError, match="last bits"):
        line.make(line.named(made.record.name))
    assert any("came out different" in text for text in heard.warnings)
    line, heard = fresh()
    assert line.make(recipes.evaluation(experiment())).record.key != made.record.key


def test_the_first_record_wins(store):
    """Two processes that no lock kept apart commit the same recipe: what is found stays what it was."""
    recipe = {"schema": 1, "stage": "sample", "version": 1, "settings": {}, "inputs": {}}
    first = store.commit(recipe, {}, Packed({"x": Array(np.zeros(2), ("row",), "1")}), {})
    second = store.commit(recipe, {}, Packed({"x": Array(np.ones(2), ("row",), "1")}), {})
    assert second == first
    assert (store.read(store.record("sample", first.key)).arrays["x"].values == 0).all()


def test_a_record_of_the_future_is_refused_by_name(fresh, store):
    recipe = {"schema": 1, "stage": "fit-future", "version": 1, "settings": {}, "inputs": {}}
    future = store.commit(recipe, {}, Packed({}), {})
    other = store.commit({**recipe, "stage": "fit-edmd", "settings": {"warp": 9}}, {}, Packed({}), {})
    for record in (future, other):
        line, _ = fresh()
        with pytest.raises(NewerFormatError, match=r"update koop|another koop"):
            line.named(record.name)


def test_an_interrupted_evaluation_goes_on_where_it_stopped(fresh, monkeypatch):
    whole = fresh()[0].make(recipes.evaluation(experiment("evaluate.first=2", "evaluate.chunk=9")))
    real, calls = evaluation.evaluate, []

    def interrupt(predictor, trajectories, rows, first, *more):
        if len(calls) == 3:
            raise KeyboardInterrupt
        calls.append(rows)
        return real(predictor, trajectories, rows, first, *more)

    from koopcli.stages import evaluate as stage

    monkeypatch.setattr(stage, "evaluate", interrupt)
    task = recipes.evaluation(experiment())
    with pytest.raises(KeyboardInterrupt):
        fresh()[0].make(task)
    calls.clear()
    line, heard = fresh()
    resumed = line.make(task)
    assert calls == [slice(30, 40)]
    assert "3 of 4 chunks were already there" in heard.notes
    assert not list((line.store.root / "partial").iterdir())
    monkeypatch.setattr(stage, "evaluate", real)
    straight = Pipeline(Store(line.store.root.parent / "other"), Listener()).make(task)
    assert straight.record.object == resumed.record.object
    assert whole.record.key != resumed.record.key


def test_another_process_may_have_made_it_meanwhile(fresh, monkeypatch):
    """What appears between the look and the lock is used."""
    task = recipes.sample(experiment().sample("grid"))
    line, _ = fresh()
    real = line.store.lock

    @contextmanager
    def late(key, name):
        with real(key, name):
            pass
        fresh()[0].make(task)
        with real(key, name):
            yield

    monkeypatch.setattr(line.store, "lock", late)
    assert line.make(task).cached


def test_the_plan_says_what_making_does(fresh):
    task = recipes.evaluation(experiment())
    line, _ = fresh()
    before = line.plan(task)
    assert [step.state for step in before] == ["make"] * 6
    assert sum(step.cost.bytes for step in before) > 0
    assert not line.store.root.exists()
    fresh()[0].make(recipes.fit_edmd(experiment()))
    states = {step.name.partition("/")[0]: step.state for step in fresh()[0].plan(task)}
    assert states["fit-edmd"] == "reuse"
    assert states["evaluate"] == "make"
    fresh()[0].make(task)
    assert [step.state for step in fresh()[0].plan(task)] == ["reuse"]


def test_an_artefact_of_another_layout_is_refused_in_words(fresh, store):
    made = fresh()[0].make(recipes.sample(experiment().sample("grid"))).record
    recipe = {**made.recipe, "version": 0}
    old = store.commit(recipe, {}, Packed({"x": Array(np.zeros(2), ("row",), "1")}), {})
    line, _ = fresh()
    with pytest.raises(DamagedArtefactError, match="another version made it"):
        line.make(line.named(old.name))
    with pytest.raises(DamagedArtefactError, match="version 0 of its stage, here 2"):
        read(old.name, store.root)


def test_the_plan_of_what_has_lost_its_past(fresh, store):
    """Estimates need the sample behind the trajectories, making does not."""
    made = fresh()[0].make(recipes.simulation(experiment())).record
    for path in (store.root / "records" / "sample").iterdir():
        path.unlink()
    line, _ = fresh()
    task = recipes.fit_edmd(experiment(), line.named(made.name))
    assert [step.state for step in line.plan(task)] == ["reuse", "make"]
    assert not line.make(task).cached


def test_records_hold_where_they_came_from(fresh):
    record = fresh()[0].make(recipes.fit_edmd(experiment())).record
    assert record.lineage["trajectories"].startswith("simulate/")
    assert record.recipe["settings"] == {"order": 2}  # what is at its default is not in the key
    assert {"time", "host", "versions", "argv", "seconds", "peak_memory_mb", "git", "code"} <= set(record.provenance)
    versions = {name: record.provenance["versions"][name] for name in ("koopcli", "numpy", "h5py")}
    assert versions == {"koopcli": koopcli.__version__, "numpy": np.__version__, "h5py": h5py.__version__}


def test_what_is_there_needs_no_digest_of_the_code(fresh, monkeypatch):
    """And is found by other code under the same key."""
    from koopcli.stages import pipeline
    from koopcli.store import parts, provenance

    task = recipes.fit_edmd(experiment())
    fresh()[0].make(task)
    for module in (pipeline, parts, provenance):
        monkeypatch.delattr(module, "code_digest")
    assert fresh()[0].make(task).cached


def test_the_key_is_in_no_way_random(fresh, tmp_path):
    one = fresh()[0].make(recipes.sample(experiment().sample("grid"))).record
    two = Pipeline(Store(tmp_path / "elsewhere"), Listener()).make(recipes.sample(experiment().sample("grid"))).record
    assert (one.key, one.object, one.data) == (two.key, two.object, two.data)
    assert one.key.startswith("a744a5669bf0")  # of these settings, for good: another key would orphan every store
