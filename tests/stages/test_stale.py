"""What today's koop would not make again under the same key, and the reason."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import pytest

from koopcli.checks import build
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.stages import stale as staleness
from koopcli.stages.registry import STAGES
from koopcli.store import Store


def why(koop) -> dict[str, str]:
    """stage -> why, of what `koop ls --stale` lists."""
    listed = koop("ls", "--stale", "--json")
    assert listed.code == 0, listed.err
    return {row["name"].partition("/")[0]: row["why"] for row in json.loads(listed.out)}


@pytest.fixture
def made(koop, folder):
    assert koop("plot", "spectrum", koop("fit-edmd").name).code == 0
    return folder / "artefacts"


def raised(stage):
    return replace(STAGES[stage], version=STAGES[stage].version + 1)


def test_nothing_is_stale_that_was_just_made(koop, made):
    assert why(koop) == {}
    assert len(koop("ls", "--stale").out.splitlines()) < 5


def test_another_version_and_all_that_follows_from_it(koop, made, monkeypatch):
    monkeypatch.setitem(STAGES, "fit-edmd", raised("fit-edmd"))
    here = STAGES["fit-edmd"].version
    found = why(koop)
    assert found == {
        "fit-edmd": f"version {here - 1} of its stage, here {here}",
        "plot": "its 0/predictor is stale",
    }
    table = koop("ls", "--stale", "fit-edmd").out
    assert "why stale" in table
    assert f"version {here - 1} of its stage" in table
    assert "spectrum" not in table


def test_what_other_code_made_is_listed_apart_from_what_has_another_name_here(koop, made, monkeypatch):
    """An edit changes no key: what it would make is found under the name of what was made before it."""
    monkeypatch.setattr(staleness, "code_digest", lambda: "9" * 64)
    monkeypatch.setitem(STAGES, "fit-edmd", raised("fit-edmd"))
    rows = json.loads(koop("ls", "--stale", "--json").out)
    kept = {row["name"].partition("/")[0]: row["why"] for row in rows if row["keeps_name"]}
    assert set(kept) == {"sample", "simulate"}
    assert all(said.startswith("made by other code (") for said in kept.values())
    first, _, second = koop("ls", "--stale").out.partition("made by other code, under the name")
    assert "fit-edmd/" in first
    assert "sample/" not in first
    assert "sample/" in second
    assert "fit-edmd/" not in second


def test_artefacts_from_before_code_was_told_count_as_those_of_other_code(made):
    record = Store(made).find("fit-edmd")
    assert staleness.other_code(record) is None
    old = replace(record, provenance={"time": record.provenance["time"]})
    assert staleness.other_code(old) == "made by a koop that told no code"


@dataclass(frozen=True)
class Longer(FitEdmd):
    """The settings of tomorrow."""

    sharpness: float = 1.0


def test_settings_that_are_new_or_gone(koop, made, monkeypatch):
    stage = STAGES["fit-edmd"]
    monkeypatch.setitem(STAGES, "fit-edmd", replace(stage, settings=lambda values: build(Longer, values)))
    assert why(koop) == {}  # what is new has a default, which is in no key

    def without(values):
        return build(FitEdmd, {"old": 1, **values})

    monkeypatch.setitem(STAGES, "fit-edmd", replace(stage, settings=without))
    assert why(koop)["fit-edmd"].startswith("settings that are no longer known (unknown setting 'old'")


def test_staleness_goes_all_the_way_down(koop, made, monkeypatch):
    monkeypatch.setitem(STAGES, "sample", raised("sample"))
    assert set(why(koop)) == {"sample", "simulate", "fit-edmd", "plot"}
    assert why(koop)["plot"] == "its 0/predictor is stale"


def test_a_stage_that_is_not_here(koop, made, monkeypatch):
    monkeypatch.delitem(STAGES, "plot")
    assert why(koop) == {"plot": "this koop has no stage plot"}


def test_other_code_draws(koop, made, monkeypatch):
    monkeypatch.setattr(staleness, "source_digest", lambda figure: "0" * 64)
    assert why(koop) == {"plot": "drawn by other code"}


def test_an_input_that_is_gone(koop, made):
    (path,) = (made / "records" / "fit-edmd").iterdir()
    path.unlink()
    assert why(koop) == {"plot": "its 0/predictor, fit-edmd, is gone"}


def test_an_input_that_came_out_different(koop, made):
    """On another machine the same key may meet data that differ in the last bits."""
    store = Store(made)
    record = store.find("fit-edmd")
    packed = store.read(record)
    (made / "records" / "fit-edmd" / f"{record.key}.json").unlink()
    store.commit(
        record.recipe, record.lineage, replace(packed, meta={**packed.meta, "condition": 1.5}), record.provenance
    )
    assert why(koop) == {"plot": "its 0/predictor has come out different since"}


def test_a_recipe_in_another_form(koop, made):
    """The last resort: nothing names the difference, but the key is another."""
    records = {f"{stage}/{key}": Store(made).record(stage, key) for stage, key in Store(made).index()}
    assert staleness.stale(records) == {}
    full = next(name for name in records if name.startswith("sample/"))
    recipe = {**records[full].recipe, "more": 1}
    records[full] = replace(records[full], recipe=recipe)
    assert staleness.stale(records)[full] == "its recipe is written differently here"
