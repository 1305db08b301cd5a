"""Work shared by processes: the same results, errors told once, nothing left running."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.errors import InvalidValueError, StorageError
from koopcli.stages import recipes
from koopcli.stages.ahead import make_ahead
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.registry import STAGES
from koopcli.stages.workers import Workers
from koopcli.store import Store
from tests.stages.test_pipeline import SMALL, Listener

CHUNKED = [*SMALL, "simulate.chunk=50"]


def double(job: int) -> int:
    return 2 * job


def refuse(job: int) -> int:
    raise StorageError("full")


def end(job: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return job


def interrupt(job: int) -> int:
    raise KeyboardInterrupt


@pytest.mark.parametrize("count", [1, 2])
def test_every_job_is_done_once(count, tmp_path):
    with Workers(count) as workers:
        assert sorted(workers.each(double, range(20), tmp_path)) == [(i, 2 * i) for i in range(20)]
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("count", [1, 2])
def test_an_error_of_a_job_is_the_commands(count, tmp_path):
    with pytest.raises(StorageError, match="full"), Workers(count) as workers:
        list(workers.each(refuse, range(5), tmp_path))


def test_an_interrupt_here_is_not_swallowed(tmp_path):
    with pytest.raises(KeyboardInterrupt), Workers() as workers:
        list(workers.each(interrupt, range(5), tmp_path))


def test_a_killed_worker_is_one_clear_error(tmp_path):
    with pytest.raises(InvalidValueError, match="fewer --workers"), Workers(2) as workers:
        list(workers.each(end, range(5), tmp_path))


def test_leaving_by_an_error_stops_the_workers(tmp_path):
    def go_wrong(workers):
        next(workers.each(double, range(20), tmp_path))
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), Workers(2) as workers:
        go_wrong(workers)
    until = time.monotonic() + 20
    while multiprocessing.active_children() and time.monotonic() < until:
        time.sleep(0.05)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("count", [0, -1, 1000])
def test_odd_counts_are_refused(count):
    with pytest.raises(InvalidValueError, match="--workers"):
        Workers(count)


def objects(store: Store) -> dict[str, str]:
    records = [store.record(stage, key) for stage, key in store.index()]
    return {record.name: record.object for record in records}


@pytest.fixture(scope="module")
def alone(tmp_path_factory) -> dict[str, str]:
    """What one process makes."""
    store = Store(tmp_path_factory.mktemp("alone"))
    Pipeline(store, Listener()).make(recipes.evaluation(load_experiment("paper", parse_set(CHUNKED))))
    return objects(store)


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_chunks_made_by_workers_are_the_same_to_the_last_bit(tmp_path, alone, count):
    store, heard = Store(tmp_path), Listener()
    with Workers(count) as workers:
        Pipeline(store, heard, workers).make(recipes.evaluation(load_experiment("paper", parse_set(CHUNKED))))
    assert objects(store) == alone
    assert not list((store.root / "partial").glob("*"))


def test_tasks_made_ahead_are_the_same_to_the_last_bit(tmp_path, alone):
    store, heard = Store(tmp_path), Listener()
    task = recipes.evaluation(load_experiment("paper", parse_set(CHUNKED)))
    with Workers(2) as workers:
        pipeline = Pipeline(store, heard, workers)
        make_ahead(pipeline, [task])
        assert objects(store) == alone
        made = len(heard.notes)
        assert sum("made in" in note for note in heard.notes) == len(alone) == made
        pipeline.make(task)
    assert len(heard.notes) == made  # all of it was said already


def test_what_cannot_be_made_ahead_is_met_in_its_place(tmp_path):
    experiment = load_experiment("paper", parse_set([*SMALL, "sample.columns=1", "sample.count=1"]))
    bad = recipes.fit_edmd(experiment)
    with Workers(2) as workers:
        pipeline = Pipeline(Store(tmp_path), Listener(), workers)
        make_ahead(pipeline, [bad])
        with pytest.raises(InvalidValueError):
            pipeline.make(bad)


def break_off(store: Store, task, done: int, monkeypatch) -> None:
    """Interrupt the making of ``task`` when so many of its chunks are there."""
    from koopcli.stages import chunks

    real, left = chunks.commit, done

    def breaking(chunk):
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        return real(chunk)

    with monkeypatch.context() as patch:
        patch.setattr(chunks, "commit", breaking)
        with pytest.raises(KeyboardInterrupt):
            Pipeline(store, Listener()).make(task)


def test_simulations_are_resumed_chunk_by_chunk(tmp_path, alone, monkeypatch):
    store = Store(tmp_path)
    task = recipes.simulation(load_experiment("paper", parse_set(CHUNKED)))
    break_off(store, task, 3, monkeypatch)
    heard = Listener()
    made = Pipeline(store, heard).make(task)
    assert "3 of 20 chunks were already there" in heard.notes
    assert alone[made.record.name] == made.record.object


FIT = ["sample.kind=box", "sample.count=300", "sample.steps=5", "fit-edmd.order=2", "fit-edmd.chunk=160"]


@pytest.mark.parametrize(
    ("workers", "done"),
    [
        *((1, done) for done in (4, 13)),
        (2, 4),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1, 0), (1, 17), (2, 0), (2, 13), (2, 17))),
    ],
)
def test_fits_are_resumed_chunk_by_chunk_in_every_pass(tmp_path, monkeypatch, done, workers):
    """Ten chunks look at the samples, ten sum over them; between them lies what the sums work with."""
    task = recipes.fit_edmd(load_experiment("paper", parse_set(FIT)))
    whole = Pipeline(Store(tmp_path / "whole"), Listener()).make(task).record
    store = Store(tmp_path / "broken")
    Pipeline(store, Listener()).make(task.input("trajectories"))
    break_off(store, task, done, monkeypatch)
    heard = Listener()
    with Workers(workers) as sharing:
        made = Pipeline(store, heard, sharing).make(task).record
    assert made.object == whole.object
    said = [note for note in heard.notes if "chunks were already there" in note]
    first, second = min(done, 10), max(done - 10, 0)
    assert said == [f"{n} of 10 chunks were already there" for n in (first, second) if n]
    assert not list((store.root / "partial").glob("*"))


@pytest.mark.slow
def test_one_long_trajectory_is_shared_as_well_as_many(tmp_path):
    """A chunk may begin and end inside a trajectory."""
    long = ["sample.kind=box", "sample.count=2", "sample.steps=700", "fit-edmd.order=1", "fit-edmd.chunk=100"]
    task = recipes.fit_edmd(load_experiment("paper", parse_set(long)))
    alone = Pipeline(Store(tmp_path / "alone"), Listener()).make(task).record
    with Workers(2) as workers:
        shared = Pipeline(Store(tmp_path / "shared"), Listener(), workers).make(task).record
    assert shared.object == alone.object


def test_damage_to_what_chunks_work_with_is_found(tmp_path, monkeypatch):
    task = recipes.fit_edmd(load_experiment("paper", parse_set(FIT)))
    whole = Pipeline(Store(tmp_path / "whole"), Listener()).make(task).record
    store = Store(tmp_path / "broken")
    Pipeline(store, Listener()).make(task.input("trajectories"))
    break_off(store, task, 14, monkeypatch)
    (given,) = (store.root / "partial" / whole.key).glob("11-*.h5")
    content = bytearray(given.read_bytes())
    content[len(content) // 2] ^= 1
    given.write_bytes(content)
    with Workers(2) as workers:
        made = Pipeline(store, Listener(), workers).make(task).record
    assert made.object == whole.object


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_sums_that_were_given_other_directions_are_not_gone_on_with(tmp_path, monkeypatch, workers):
    """Where another machine goes on, its directions of the inputs may be others, as good: nothing is mixed."""
    task = recipes.fit_edmd(load_experiment("paper", parse_set(FIT)))
    whole = Pipeline(Store(tmp_path / "whole"), Listener()).make(task)
    store = Store(tmp_path / "broken")
    Pipeline(store, Listener()).make(task.input("trajectories"))
    real = np.linalg.svd
    with monkeypatch.context() as patch:
        patch.setattr(np.linalg, "svd", lambda *args, **told: turned(*real(*args, **told)))
        break_off(store, task, 14, patch)
    heard = Listener()
    with Workers(workers) as sharing:
        made = Pipeline(store, heard, sharing).make(task)
    assert made.record.object == whole.record.object
    assert [note for note in heard.notes if "already there" in note] == ["10 of 10 chunks were already there"]


def turned(U, singular, Vt):
    return -U, singular, -Vt


def test_jobs_of_other_code_are_refused(tmp_path):
    """A worker may have been running since before an edit, which leaves every version as it is."""
    from koopcli.stages import ahead, chunks

    task = recipes.sample(load_experiment("paper", {}).sample("grid"))
    with pytest.raises(InvalidValueError, match="begin the workers again"):
        ahead.make(ahead.Making(tmp_path, task, "9" * 64))
    with pytest.raises(InvalidValueError, match=r"other code of koopcli \(.{12}\) than this command \(9{12}\)"):
        chunks.commit(chunks.Chunk(tmp_path, "simulate", None, "0" * 64, (), code="9" * 64))


class Thread:
    """An engine that costs no process."""

    alone, width = False, 2

    def start(self, store):
        return ThreadPoolExecutor(1)

    def stop(self, executor, *, at_once):
        executor.shutdown()

    def died(self, error):
        return None


def test_a_worker_of_other_code_ends_making_ahead(tmp_path, monkeypatch):
    """It joined after the others had been looked at. The command does not go on as if that were one bad setting."""
    from koopcli.stages import ahead

    monkeypatch.setattr(ahead, "code_digest", lambda: "9" * 64)
    task = recipes.sample(load_experiment("paper", {}).sample("grid"))
    sharing = Workers()
    sharing._engine = Thread()
    with pytest.raises(InvalidValueError, match="other code"), sharing:
        make_ahead(Pipeline(Store(tmp_path), Listener(), sharing), [task])


def test_chunks_of_other_code_are_not_gone_on_with(tmp_path, alone, monkeypatch):
    """Between an interruption and the next command koop was edited."""
    from koopcli.store import parts

    store = Store(tmp_path)
    task = recipes.simulation(load_experiment("paper", parse_set(CHUNKED)))
    with monkeypatch.context() as patch:
        patch.setattr(parts, "code_digest", lambda: "9" * 64)
        break_off(store, task, 3, patch)
    heard = Listener()
    made = Pipeline(store, heard).make(task)
    assert "3 chunks were made by other code of koopcli: they are dropped and made again" in heard.notes
    assert not [note for note in heard.notes if "already there" in note]
    assert alone[made.record.name] == made.record.object


def test_waiting_for_nobody_is_said(monkeypatch):
    from concurrent.futures import Future

    from koopcli.stages import workers as module

    monkeypatch.setattr(module, "PATIENCE", 0.01)
    sharing, job, heard = Workers(), Future(), []

    def warn(text):
        heard.append(text)
        job.set_result(1)

    monkeypatch.setattr(type(sharing._engine), "stalled", lambda self: "nobody is left")
    sharing.warn = warn
    assert sharing.done([job]) == {job}
    assert heard == ["nobody is left"]


def test_without_locks_chunks_may_be_cleared_while_they_are_joined(tmp_path, alone, monkeypatch):
    """Another process finishes the artefact just before this one reads its chunks once more: its record wins."""
    from contextlib import nullcontext

    from koopcli.store import parts

    monkeypatch.setattr(parts, "HELD", 0)  # chunks stay on disk
    monkeypatch.setattr(Store, "lock", lambda self, key, name: nullcontext())
    task = recipes.simulation(load_experiment("paper", parse_set(CHUNKED)))
    real, calls = Store.commit, []

    def overtaken(self, recipe, *rest):
        calls.append(recipe["stage"])
        if calls.count("simulate") == 1 and recipe["stage"] == "simulate":
            Pipeline(Store(tmp_path), Listener()).make(task)
        return real(self, recipe, *rest)

    monkeypatch.setattr(Store, "commit", overtaken)
    made = Pipeline(Store(tmp_path), Listener()).make(task)
    assert calls.count("simulate") == 2
    assert made.cached
    assert made.record.object == alone[made.record.name]


def test_chunks_beyond_what_is_held_in_memory_are_the_same(tmp_path, alone, monkeypatch):
    from koopcli.store import parts

    monkeypatch.setattr(parts, "HELD", 40_000)  # some are held, some are not
    store = Store(tmp_path)
    Pipeline(store, Listener()).make(recipes.evaluation(load_experiment("paper", parse_set(CHUNKED))))
    assert objects(store) == alone


def test_a_worker_whose_inputs_are_gone_leaves_its_chunk_to_the_command(tmp_path, alone, monkeypatch):
    """As when somebody collects what is in use: the command has read it already."""
    from koopcli.stages import chunks

    store = Store(tmp_path)
    task = recipes.simulation(load_experiment("paper", parse_set(CHUNKED)))
    real = Workers.each

    def collected(self, function, jobs, store_root):
        for path in (store.root / "records" / "sample").iterdir():
            path.unlink()
        chunks._content_of.cache_clear()
        return real(self, function, jobs, store_root)

    monkeypatch.setattr(Workers, "each", collected)
    with Workers(2) as workers:
        made = Pipeline(store, Listener(), workers).make(task)
    assert made.record.object == alone[made.record.name]


def test_chunks_that_are_there_need_no_room_again(tmp_path, monkeypatch):
    """With room for the whole and one chunk more, an interrupted simulation ends."""
    from koopcli.store import files

    store = Store(tmp_path)
    task = recipes.simulation(load_experiment("paper", parse_set(CHUNKED)))
    break_off(store, task, 19, monkeypatch)
    needed = STAGES["simulate"].estimate(task).bytes
    monkeypatch.setattr(files, "_free", lambda path: 1.1 * needed)
    Pipeline(store, Listener()).make(task)
    with pytest.raises(StorageError, match="needed"):
        Pipeline(Store(tmp_path / "other"), Listener()).make(task)


def test_a_worker_that_is_killed_ends_making_ahead(tmp_path, monkeypatch):
    """Its job was the last one: nothing else would notice."""
    from koopcli.stages import ahead

    monkeypatch.setattr(ahead, "make", end)
    task = recipes.sample(load_experiment("paper", {}).sample("grid"))
    with pytest.raises(InvalidValueError, match="fewer --workers"), Workers(2) as workers:
        make_ahead(Pipeline(Store(tmp_path), Listener(), workers), [task])
