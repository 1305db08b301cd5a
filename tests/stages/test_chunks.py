"""A chunk that is computed where its inputs are found in the store, as by a worker."""

from __future__ import annotations

import pytest

from koopcli.errors import DamagedArtefactError
from koopcli.stages import chunks, recipes
from koopcli.stages.chunks import Chunk, commit
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.recorded import content_of
from koopcli.stages.registry import STAGES
from koopcli.store import Store
from koopcli.store.code import code_digest
from koopcli.store.identity import data_digest
from tests.stages.test_pipeline import Listener, experiment

KEY = "f" * 64


@pytest.fixture
def chunk(store) -> Chunk:
    """Of trajectories whose sample is in the store."""
    task = recipes.simulation(experiment())
    made = Pipeline(store, Listener()).make(task.inputs[0][1]).record
    inputs = (("sample", f"{made.stage}/{made.key}"),)
    return Chunk(store.root, "simulate", task.settings, KEY, inputs, 3, 10, 20, code=code_digest())


def sample_of(chunk: Chunk, store: Store):
    return store.record(*chunk.inputs[0][1].split("/"))


def test_it_is_computed_from_what_the_store_holds(store, chunk):
    assert commit(chunk) == []
    at_hand = {"sample": content_of(sample_of(chunk, store), store)}
    chunk_of = STAGES["simulate"].chunk
    expected = chunk_of(chunk.settings, at_hand, slice(10, 20), chunk.progress)
    assert data_digest(store.parts(KEY).read({3})[3]) == data_digest(expected)


@pytest.mark.parametrize("how", ["gone", "another"])
def test_it_is_left_out_where_its_input_changes_just_before_it_is_read(store, chunk, monkeypatch, how):
    """It was named by one record, which another process removes or replaces before its content is read."""
    named = sample_of(chunk, store)
    other = Pipeline(store, Listener()).make(recipes.simulation(experiment("sample.seed=9")).inputs[0][1]).record

    class Changing(Store):
        reads = 0

        def record(self, stage, key):
            Changing.reads += 1
            return named if Changing.reads == 1 else None if how == "gone" else other

    monkeypatch.setattr(chunks, "_store", Changing)
    chunks._content_of.cache_clear()
    assert commit(chunk) == []
    assert Changing.reads == 2
    assert store.parts(KEY).read({3}) == {}


def test_it_is_left_out_where_its_input_is_damaged(store, chunk):
    chunks._content_of.cache_clear()
    path = store.path(sample_of(chunk, store))
    path.write_bytes(path.read_bytes()[:-1])
    commit(chunk)
    with pytest.raises(DamagedArtefactError, match="missing"):
        store.read(sample_of(chunk, store))
    assert store.parts(KEY).read({3}) == {}
