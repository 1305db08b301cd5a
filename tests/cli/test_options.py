"""An option that is a setting does what --set of that setting does."""

from __future__ import annotations

from contextlib import suppress
from types import NoneType
from typing import Literal, get_args, get_origin, get_type_hints

import pytest

from koopcli.checks import build
from koopcli.cli import baseline, evaluating, fit_edmd, fit_eigen, making
from koopcli.config import experiment
from koopcli.config.changes import flat
from koopcli.errors import KoopError
from koopcli.koopman.eigen.fit import FitEigen

COMMANDS = (
    making.sample,
    making.simulate,
    fit_edmd.fit_edmd,
    fit_eigen.fit_eigen,
    baseline.baseline,
    evaluating.evaluate,
)
WRITTEN = {int: "007", float: ".5", bool: "true"}  # as an option takes it, but not TOML
NAMED = {"vehicle": "rimac-2018", "mirror": ["left-right"]}


@pytest.fixture
def changes_of(monkeypatch):
    """Every setting that a command is told to change, by full name; the command ends there."""
    found = {}

    def spy(name, changes):
        found.update(flat(changes))
        raise KoopError

    def of(command, **given):
        found.clear()
        with suppress(KoopError):
            command(**given, **({"context": None} if command is evaluating.evaluate else {}))
        return dict(found)

    monkeypatch.setattr(experiment, "load_experiment", spy)
    return of


def options(command):
    """The options of a command that may be settings, each with values for it."""
    for name, kind in get_type_hints(command).items():
        inner = next((one for one in get_args(kind) if one is not NoneType), kind)
        if name in NAMED:
            yield name, [NAMED[name]]
        elif get_origin(kind) is Literal or get_origin(inner) is Literal:
            yield name, get_args(kind if get_origin(kind) is Literal else inner)
        elif NoneType in get_args(kind) and inner in WRITTEN:
            yield name, [inner(WRITTEN[inner])]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.__name__)
def test_an_option_is_a_setting_by_another_name(command, changes_of):
    choices = dict(options(command))
    for i in range(max(map(len, choices.values()))):
        given = {name: values[i % len(values)] for name, values in choices.items()}
        told = changes_of(command, **given)
        assert len(told) == len(given)
        words = [f"{name}={WRITTEN.get(type(v)) or (v[0] if isinstance(v, list) else v)}" for name, v in told.items()]
        positional = {name: given[name] for name in ("kind",) if command is baseline.baseline}
        same = changes_of(command, set_=words, **positional)
        for name, value in told.items():
            if isinstance(value, list):
                assert build(FitEigen, {"mirror": same[name]}).mirror == tuple(value)
            else:
                assert same[name] == value, name
