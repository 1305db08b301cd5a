"""How deep what comes from elsewhere may nest is the same under every Python, at every entrance."""

from __future__ import annotations

import json

import h5py
import pytest

from koopcli.config.changes import nested, parse_set
from koopcli.config.experiment import load_experiment
from koopcli.config.grids import parse_grid
from koopcli.errors import InvalidValueError, UsageError
from koopcli.parsing import TooDeepError, parse_json, parse_toml
from koopcli.stages import repair
from koopcli.store import Record, image, survey
from koopcli.store.identity import SCHEMA, key_of
from koopcli.store.records import BadRecordError
from koopcli.vehicles.parameters import read_vehicle
from tests.store import hostile

SENTENCE = "nested over 64 levels deep"
LEVELS = [65, 1000, 100_000]  # the last two are past the limit of some parser of some Python


def lists(levels: int) -> str:
    return "[" * levels + "]" * levels


@pytest.mark.parametrize("opening", ["[", '{"a":'])
def test_levels_of_json(opening):
    closing = {"[": "]"}.get(opening, "}")

    def text(levels):
        return opening * levels + "1" + closing * levels

    assert parse_json(text(64))
    assert parse_json(text(64).encode())
    for levels in LEVELS:
        with pytest.raises(TooDeepError, match=SENTENCE):
            parse_json(text(levels))


@pytest.mark.parametrize("of", [lists, lambda levels: "{a=" * levels + "1" + "}" * levels])
def test_levels_of_toml(of):
    assert parse_toml(f"value = {of(64)}")
    for levels in LEVELS:
        with pytest.raises(TooDeepError, match=SENTENCE):
            parse_toml(f"value = {of(levels)}")


def test_tables_that_no_parser_nests_by_recursion():
    assert parse_toml("[" + ".".join("a" * 64) + "]")
    with pytest.raises(TooDeepError, match=SENTENCE):
        parse_toml("[" + ".".join("a" * 1000) + "]")


def test_many_values_are_not_many_levels():
    assert len(parse_json("[" + "[]," * 1000 + "{}]")) == 1001


def facts(folder, levels):
    path = folder / "x.h5"
    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        hostile.honest(file)
        del file["meta"]
        hostile.put_facts(file, '{"a":' + lists(levels - 1) + "}")
    image.read_foreign(path)


def experiment(folder, levels):
    (folder / "x.toml").write_text(f"[sample]\nseed = {lists(levels - 1)}")
    load_experiment(str(folder / "x.toml"), {})


def vehicle(folder, levels):
    (folder / "x.toml").write_text(f"[parameters]\nm = {lists(levels - 1)}")
    read_vehicle(folder / "x.toml")


def set_value(folder, levels):
    load_experiment("paper", parse_set([f"sample.seed={lists(levels)}"]))


def set_name(folder, levels):
    nested([(".".join(["sample"] + ["a"] * levels), 1)])


def swept_value(folder, levels):
    parse_grid([f"sample.seed={lists(levels)}"])


@pytest.mark.parametrize("levels", LEVELS)
@pytest.mark.parametrize("entrance", [facts, experiment, vehicle, set_value, set_name, swept_value])
def test_every_entrance_tells_the_same(entrance, levels, tmp_path):
    with pytest.raises((InvalidValueError, UsageError), match=SENTENCE) as error:
        entrance(tmp_path, levels)
    assert len(str(error.value)) < 400


@pytest.mark.parametrize("entrance", [facts, set_name, swept_value])
def test_64_levels_come_in(entrance, tmp_path):
    entrance(tmp_path, 64)


@pytest.mark.parametrize("entrance", [experiment, vehicle, set_value])
def test_what_is_wrong_with_64_levels_is_something_else(entrance, tmp_path):
    with pytest.raises(InvalidValueError, match="must be"):
        entrance(tmp_path, 64)


@pytest.mark.parametrize(("levels", "good"), [(64, True), *((levels, False) for levels in LEVELS)])
def test_records_and_what_is_read_beside_them(tmp_path, levels, good):
    """What does not read here has no sentence of its own: it is damaged."""
    recipe = {"schema": SCHEMA, "stage": "sample", "version": 1, "settings": {}, "inputs": {}}
    record = Record(recipe, {}, "0" * 64, 1, "0" * 64, {"a": []})
    text = record.to_json().decode()
    if good:
        deep = Record(recipe, {}, "0" * 64, 1, "0" * 64, {"a": json.loads(lists(levels - 2))}).to_json()
        assert Record.from_json(deep, "sample", record.key).key == record.key
    else:
        with pytest.raises(BadRecordError):
            Record.from_json(text.replace('"a": []', f'"a": {lists(levels - 2)}').encode(), "sample", record.key)

    pin = tmp_path / "refs" / "x.json"
    pin.parent.mkdir()
    pin.write_text('{"names": [], "more": ' + lists(levels - 1) + "}")
    assert survey.pinned(tmp_path) == {"x": [] if good else None}

    lost = tmp_path / "sample" / f"{key_of(recipe)}.json"
    lost.parent.mkdir()
    lost.write_text(json.dumps({"recipe": recipe})[:-1] + f', "more": {lists(levels - 1)}}}')
    assert (repair._recipe(lost, f"sample/{key_of(recipe)}") is not None) == good
