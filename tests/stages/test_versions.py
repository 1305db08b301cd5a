"""A stage whose result changes must change its version, or the store would serve stale results."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace

import pytest

from koopcli.choices import Choice, setting
from koopcli.figures.kit import style
from koopcli.koopman.bases.basis import BasisChoice
from koopcli.simulation import integrate
from koopcli.stages.base import Task
from koopcli.stages.recorded import recipe_of
from koopcli.stages.registry import STAGES
from koopcli.store.identity import key_of
from tests.stages import toys
from tests.stages.toys import PINS, TOYS, complaint, made


@pytest.fixture
def pins():
    return json.loads(PINS.read_text())


@pytest.fixture
def calm(monkeypatch, pins):
    """One toy of the plant ``forces``, and its pin: as good as all, where another thing is asked."""
    monkeypatch.setitem(TOYS, "simulate", TOYS["simulate"][:1])
    pins["simulate"]["results"] = {k: v for k, v in pins["simulate"]["results"].items() if k[:2] in ("0:", "0/")}
    return pins


def test_every_stage_has_a_toy():
    assert TOYS.keys() == STAGES.keys()


@pytest.fixture(scope="module", params=STAGES)
def stage_and_made(request):
    """A stage and what it makes of its toys, made once; pictures, which are not compared, are not rendered."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "render", lambda figure, image, line: b"image")
        return request.param, made(request.param)


def test_a_default_changes_only_with_the_version_of_its_stage(pins):
    """What is at its default is in no key, so another default would be served what the old one made."""
    now = toys.defaults()
    assert toys.changed_defaults(pins, now) == []
    now["fit-edmd"] |= {"fit-edmd.basis.tensor.order": 6, "fit-edmd.basis.new.size": 3}
    assert [text.split(" was ")[0] for text in toys.changed_defaults(pins, now)] == [
        "fit-edmd: fit-edmd.basis.tensor.order"
    ]


@pytest.mark.parametrize("stage", STAGES)
def test_a_new_setting_changes_no_key(stage, monkeypatch):
    """Of any stage, with a default: what was made before is still what is asked for."""
    for settings, _ in TOYS[stage]:
        before = key_of(recipe_of(Task(stage, settings), {}))
        cls = type(settings)
        more = dataclasses.make_dataclass("More", [("novel", int, 3)], bases=(cls,), frozen=True, kw_only=True)
        made_of = {f.name: getattr(settings, f.name) for f in dataclasses.fields(cls)}
        assert key_of(recipe_of(Task(stage, more(**made_of)), {})) == before
        assert key_of(recipe_of(Task(stage, more(**made_of, novel=4)), {})) != before


def test_a_new_kind_changes_no_key(monkeypatch):
    """Of a basis, with settings of its own."""

    def keys():
        of = [settings for settings, _ in TOYS["fit-edmd"]]
        return [key_of(recipe_of(Task("fit-edmd", settings), {})) for settings in of]

    before, kinds = keys(), BasisChoice.kinds()
    novel = dataclasses.make_dataclass(
        "NovelBasis", [("size", int, setting(4, help="how large"))], bases=(Choice,), frozen=True,
        namespace={"kind": "novel"},
    )  # fmt: skip
    monkeypatch.setattr(BasisChoice, "kinds", lambda: {**kinds, "novel": novel})
    assert keys() == before


def test_results_and_versions_agree(stage_and_made, pins):
    stage, found = stage_and_made
    assert complaint(stage, pins, found) is None


def test_a_small_change_of_any_stage_is_found(stage_and_made, pins):
    """One array off by a thousandth of a percent: enough for every stage."""
    stage, found = stage_and_made

    def off(packed):
        name = max(packed.arrays, key=lambda n: packed.arrays[n].values.size if n != "image" else 0)
        array = packed.arrays[name]
        return replace(packed, arrays={**packed.arrays, name: replace(array, values=array.values * (1 + 1e-5))})

    for label, (packed, figures) in found.items():
        if any(name != "image" for name in packed.arrays):
            moved = {**found, label: (off(packed), figures)}
            if toys.results(moved) != toys.results(found):  # not nothing but zeros
                assert "raise its version" in complaint(stage, pins, moved)
                break
    else:
        pytest.fail("no toy has an array that a change would show in")


def test_what_a_stage_makes_is_shown_in_few_words_and_equal_to_itself_alone(stage_and_made):
    """Every kind of record, read twice; one value of it off by the last bit."""
    stage, found = stage_and_made
    packed = [one for one, _ in found.values()]
    records = [STAGES[stage].unpack(one) for one in packed]
    for record, one in zip(records, packed, strict=True):
        assert record == STAGES[stage].unpack(one)
        assert len(repr(record)) < 600
        assert repr(record).count("\n") < 3
    if dataclasses.is_dataclass(records[0]):
        assert all(a != b for i, a in enumerate(records) for b in records[:i] if a.pack() != b.pack())


def test_a_changed_result_without_a_changed_version_is_found(calm, monkeypatch):
    assert complaint("simulate", calm, made("simulate")) is None
    monkeypatch.setattr(integrate, "rk4_step", lambda rhs, x, u, dt: x + dt * rhs(x, u))
    assert "raise its version" in complaint("simulate", calm, made("simulate"))
    assert complaint("fit-edmd", calm, made("fit-edmd")) is None  # toys are made by no other stage


def test_a_changed_figure_is_found_too(pins, monkeypatch):
    """What scripts read is pinned as well as the arrays."""
    from koopcli.koopman.edmd import operators

    monkeypatch.setattr(operators, "condition_number", lambda values: 2.0 * values.max() / values.min())
    assert "raise its version" in complaint("fit-edmd", pins, made("fit-edmd"))


def test_a_new_toy_asks_for_a_pin_and_no_version(pins):
    """A raised version would make every stored artefact of the stage stale, though none of them changed."""
    found = made("fit-edmd")
    old = {f"new {label}": one for label, one in found.items()} | found
    assert complaint("fit-edmd", pins, old) == "fit-edmd has a new toy: pin it (make pins)"
    assert complaint("fit-edmd", pins, {"0": found["0"]}) == "fit-edmd has lost a toy: pin it (make pins)"
    assert "raise its version" in complaint("fit-edmd", pins, {**old, "0": found["1"]})


def test_a_toy_between_the_others_is_a_new_one(monkeypatch):
    """Named toys, such as a figure each, keep their pins wherever one is put in."""
    settings, inputs = toys.TOYS["baseline"][0]
    named = [(toys.figure_settings(name), inputs) for name in ("orders", "tyre")]
    monkeypatch.setitem(TOYS, "baseline", [named[0], (settings, inputs), named[1], (settings, inputs)])
    monkeypatch.setitem(STAGES, "baseline", replace(STAGES["baseline"], run=lambda s, i, c: toys._forecast("hold")))
    assert list(made("baseline")) == ["orders", "0", "tyre", "1"]


def test_a_new_version_asks_for_a_new_pin(pins, monkeypatch):
    monkeypatch.setitem(STAGES, "simulate", replace(STAGES["simulate"], version=99))
    assert "version 99" in complaint("simulate", pins, {})
