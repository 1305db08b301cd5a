"""What is printed after a score that does not beat a baseline: it runs as printed, and keeps what the user meant."""

from __future__ import annotations

import json
import re
import shlex

import pytest

INNER = re.compile(r'"\$\(koop (.*?)\)"')
SMALL = ("sample.count=5", "sample.columns=2", "fit-edmd.order=2")
SETS = tuple(word for text in SMALL for word in ("--set", text))
TEST = ("--excitation", "held", "--count", "20", "--steps", "8")
PREDICTED, TRAINED = "predictor / trajectories (simulate)", "predictor / trajectories / sample (sample)"
TESTED = ("trajectories (simulate)", "trajectories / sample (sample)")


def scored(result):
    assert result.code == 0, result.err
    return json.loads(result.out)


def told(found):
    """The command of some advice."""
    return found["advice"].partition(": koop ")[2]


def typed(koop, command, *more):
    """What a shell makes of a command line, with the one inside it."""
    inner = INNER.search(command)
    if inner is not None:
        made = koop(*shlex.split(inner[1]), tiny=False)
        assert made.code == 0, made.err
        command = command.replace(inner[0], made.name)
    return scored(koop(*shlex.split(command), *more, "--json", tiny=False))


def settings(koop, found):
    return scored(koop("show", found["name"], "--json"))["settings"]


def test_the_command_line_keeps_its_options(koop):
    mine = ("--vehicle", "bmw-320i", "--set", "vehicle.Jzz=1731", "--set", "sample.seed=3")
    found = scored(koop("evaluate", *SETS, *TEST, *mine, "--json", tiny=False))
    command = told(found)
    assert command.startswith("evaluate --experiment best-edmd ")
    assert "--vehicle bmw-320i" in command
    assert "fit-edmd.order=2" not in command
    before, after = settings(koop, found), settings(koop, typed(koop, command))
    for part in (PREDICTED, TRAINED, *TESTED):
        assert after[part] == before[part]
    fit = after["predictor (fit-edmd)"]
    assert (fit["terms"], fit["order"]) == ("generator", 4)  # as many powers as five values per state carry


def test_a_named_predictor_and_an_own_experiment_keep_their_data(koop):
    fit = koop("fit-edmd", "--set", "vehicle.m=1500").name
    done = koop("evaluate", fit, *TEST, "--set", "evaluate.relift=false", "--json")
    found = scored(done)
    assert f"\n{found['advice']}\n" in done.err
    command = told(found)
    assert "--experiment ../tiny.toml" in INNER.sub("", command)
    before, after = settings(koop, found), settings(koop, typed(koop, command))
    for part in (PREDICTED, TRAINED, *TESTED, "evaluate"):
        assert after[part] == before[part]
    assert after["predictor (fit-edmd)"]["terms"] == "generator"


def test_eigenfunctions_of_an_own_vehicle(koop):
    """Its parameters are said where no shipped vehicle has them; the best fit itself is only planned."""
    mine = ("--vehicle", "rimac-2018", "--set", "vehicle.m=1500", "--set", "sample.energy=4e5")
    found = scored(koop("evaluate", koop("fit-eigen", *mine).name, "--json"))
    inner = INNER.search(told(found))[1]
    assert inner == (
        "fit-eigen --experiment best-eigen --vehicle rimac-2018 --set vehicle.m=1500 --set sample.energy=400000"
    )
    plan = scored(koop(*shlex.split(inner), "--dry-run", "--json", tiny=False))
    greedy, simulation, fit = (step["settings"] for step in plan["steps"])
    assert (greedy["kind"], greedy["energy"], simulation["vehicle"]["m"]) == ("greedy", 4e5, 1500.0)
    assert fit["lift"] == "polyharmonic"


def test_another_vehicles_trajectories(koop):
    test = koop("simulate", koop("sample", "box", "--count", "20", "--steps", "5").name, "--set", "vehicle.m=3000")
    predictor = koop("fit-edmd", "--basis", "states").name
    found = scored(koop("evaluate", predictor, "--on", test.name, "--json"))
    assert told(found) == f"evaluate {predictor} --experiment ../tiny.toml"


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (("sample.levels=[0]",), "no input moves in the training data"),
        (("sample.kind=box", "sample.count=12", "sample.steps=4"), "see docs/paper.md for what does better"),
        (
            ("fit-edmd.basis=anisotropic", "fit-edmd.order=4", "fit-edmd.terms=generator", "test.excitation=none"),
            "see ",
        ),
    ],
)
def test_where_there_is_nothing_to_type(koop, sets, words):
    options = [word for text in sets for word in ("--set", text)]
    found = scored(koop("evaluate", *options, "--set", "fit-edmd.order=1", *TEST[2:], "--json"))
    assert words in found["advice"]
    assert "koop evaluate" not in found["advice"]


def test_none_is_given_to_a_good_predictor_and_to_a_baseline(koop):
    good = ("fit-edmd.basis=anisotropic", "fit-edmd.order=4", "fit-edmd.terms=generator")
    options = [word for text in good for word in ("--set", text)]
    found = scored(koop("evaluate", *options, "--steps", "30", "--excitation", "held", "--count", "20", "--json"))
    assert (found["beats_baselines"], found["advice"]) == (True, None)
    poor = scored(koop("evaluate", koop("baseline", "hold").name, "--json"))
    assert (poor["beats_baselines"], poor["advice"]) == (False, None)
