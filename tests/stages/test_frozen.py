"""A store that the first code of this format wrote: read, verified, and known by the same keys."""

from __future__ import annotations

import shutil

import pytest

from koopcli.stages.base import Task
from koopcli.stages.recorded import content_of, recipe_of, settings_of
from koopcli.stages.registry import STAGES
from koopcli.stages.repair import opens
from koopcli.store import Store
from koopcli.store.identity import data_digest, key_of
from koopcli.store.pins import pins
from koopcli.store.verify import verify
from tests.stages.frozen import STORE, tasks


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """A copy, which a failing read cannot change."""
    return Store(shutil.copytree(STORE, tmp_path_factory.mktemp("frozen") / "store"))


def records(store):
    return {f"{stage}/{key}": store.record(stage, key) for stage, key in store.index()}


def test_it_has_something_of_every_stage(frozen):
    assert {record.stage for record in records(frozen).values()} == STAGES.keys()
    assert set(pins(frozen)["kept"]) == records(frozen).keys()


def test_nothing_of_it_is_damaged(frozen):
    report = verify(frozen, opens)
    assert [finding.what for finding in report.findings] == []


def test_everything_is_read_and_holds_what_it_held(frozen):
    for record in records(frozen).values():
        assert data_digest(frozen.read(record)) == record.data
        packed = content_of(record, frozen).pack()
        if record.recipe["version"] == STAGES[record.stage].version:
            assert data_digest(packed) == record.data


def test_its_settings_give_its_keys(frozen):
    """But for the version of a stage that computes otherwise by now."""
    known = records(frozen)
    for full, record in known.items():
        inputs = {role: known[name] for role, name in record.lineage.items()}
        recipe = recipe_of(Task(record.stage, settings_of(record)), inputs)
        assert f"{record.stage}/{key_of({**recipe, 'version': record.recipe['version']})}" == full


def test_what_is_asked_for_as_then_is_planned_as_then(frozen):
    """Settings, kinds and stages may have been added since."""
    known = list(records(frozen).values())
    for task in tasks():
        for step in task.upstream():
            recipe = recipe_of(step, {})
            alike = [record.recipe for record in known if record.stage == step.stage]
            if step.stage != "plot":  # whose code is in its settings
                assert recipe["settings"] in [old["settings"] for old in alike]
