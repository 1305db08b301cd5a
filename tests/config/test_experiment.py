from __future__ import annotations

import tomllib
from dataclasses import asdict, fields
from typing import get_args, get_type_hints

import pytest

from koopcli.config import settings
from koopcli.config.data import data_folder
from koopcli.config.experiment import SECTIONS, load_experiment, parse_set
from koopcli.config.settings import BoxSample, Evaluate, FitEdmd, GridSample, Reproduce, Simulate
from koopcli.errors import InvalidValueError, UnknownNameError, UsageError
from koopcli.figures.registry import FIGURES
from koopcli.koopman.bases import BASES
from koopcli.simulation.sampling import DRAWS
from koopcli.vehicles.plants import PLANTS, WHEELS_PER_FORCE

PAPER = tomllib.loads((data_folder() / "experiments" / "paper.toml").read_text())


@pytest.mark.parametrize(
    ("literal", "registry"),
    [
        (settings.Draw, DRAWS),
        (settings.PlantName, PLANTS),
        (settings.ForcePer, WHEELS_PER_FORCE),
        (settings.BasisName, BASES),
        (settings.FigureName, FIGURES),
        (settings.Kind, settings.SAMPLES),
    ],
)
def test_option_names_are_the_registries(literal, registry):
    assert set(get_args(literal)) == set(registry)


def test_the_paper_file_writes_out_every_default():
    """`paper.toml` and the defaults in the code are one thing said twice; neither may drift."""
    loaded = load_experiment("paper", {})
    assert loaded.sample == GridSample()
    assert loaded.test == BoxSample()
    assert loaded.fit_edmd == FitEdmd()
    assert loaded.evaluate == Evaluate()
    assert loaded.reproduce == Reproduce()
    assert loaded.simulate == Simulate(vehicle=loaded.simulate.vehicle)
    for section, cls in {"sample": GridSample, "test": BoxSample, "fit-edmd": FitEdmd, "evaluate": Evaluate}.items():
        assert set(PAPER[section]) == {f.name for f in fields(cls)}
    assert set(PAPER) == set(SECTIONS)


def test_every_setting_has_a_help_text():
    for cls in (GridSample, BoxSample, FitEdmd, Evaluate, Simulate, Reproduce):
        hints = get_type_hints(cls)
        for f in fields(cls):
            if f.name not in ("kind", "vehicle"):
                assert f.metadata["help"], (cls.__name__, f.name, hints[f.name])


def test_the_command_line_is_laid_over_the_file():
    changed = load_experiment("smoke", parse_set(["vehicle.Jzz=1731", "sample.seed=3", "fit-edmd.order=2"]))
    assert changed.simulate.vehicle.Jzz == 1731.0
    assert (changed.sample.seed, changed.sample.count) == (3, 7)  # the count is the smoke file's
    assert changed.fit_edmd.order == 2


def test_a_change_of_kind_starts_afresh():
    assert load_experiment("paper", parse_set(["sample.kind=box"])).sample == BoxSample()


def test_values_are_toml_or_plain_text():
    parsed = parse_set(["sample.levels=[1, 2]", "sample.draw=even", "test.amplitude = 1e3", 'vehicle.name="x"'])
    assert parsed == {
        "sample": {"levels": [1, 2], "draw": "even"},
        "test": {"amplitude": 1e3},
        "vehicle": {"name": "x"},
    }
    assert parse_set(["vehicle.m=1\na=2"]) == {"vehicle": {"m": "1\na=2"}}  # one value, not two lines of TOML


@pytest.mark.parametrize("text", ["sample", "sample.seed", "seed=1", ".seed=1", "sample.=1", "planet.mass=1"])
def test_a_malformed_assignment_is_refused(text):
    with pytest.raises(UsageError, match="--set"):
        parse_set([text])


def test_a_vehicle_beside_the_experiment_file(tmp_path):
    text = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    (tmp_path / "heavy.toml").write_text(text.replace("1300.0", "2600.0"))
    (tmp_path / "mine.toml").write_text('[vehicle]\nname = "heavy.toml"\nJzz = 3000\n')
    vehicle = load_experiment(str(tmp_path / "mine.toml"), {}).simulate.vehicle
    assert (vehicle.m, vehicle.Jzz) == (2600.0, 3000.0)
    again = load_experiment(str(tmp_path / "mine.toml"), parse_set(["vehicle.name=ctu-2020"])).simulate.vehicle
    assert (again.m, again.Jzz) == (1300.0, 1400.0)  # another vehicle leaves the changes of the first behind


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[sampel]\nseed = 1", "unknown section 'sampel'"),
        ("[sample]\nsede = 1", "unknown setting 'sample.sede'"),
        ("[sample]\ndraw = 'odd'", "'sample.draw' cannot be 'odd'"),
        ("[sample]\nkind = 'ball'", "unknown kind of sample 'ball'"),
        ("[sample]\nkind = ['grid']", "unknown kind of sample ['grid']"),
        ("[sample]\nbox = [1e13, 1.0, 1.0]", "'sample.box[0]' must be at most 1e+12"),
        ("[reproduce]\norders = [3, 3]", "'reproduce.orders' names a value twice"),
        ("[simulate.vehicle]\nm = 1.0", "the vehicle has a section of its own"),
        ("[test]\ncount = 0", "'test.count' must be at least 1"),
        ("[test]\nkind = 'grid'", "'test.kind' cannot be 'grid'"),
        ("[vehicle]\nJzz = -1", "'vehicle.Jzz' must be above 0"),
        ("sample = 3", "must stand in a table"),
        ("[sample", "cannot read"),
        ("[sample]\nseed = " + "9" * 5000, "cannot read"),
        ("[sample]\nlevels = " + "[" * 3000, "cannot read"),
    ],
)
def test_a_bad_experiment_file_is_refused_by_file_and_key(tmp_path, text, says):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InvalidValueError) as caught:
        load_experiment(str(path), {})
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


def test_an_unknown_experiment_lists_the_shipped_ones():
    with pytest.raises(UnknownNameError, match=r"known: paper, smoke"):
        load_experiment("papre", {})


def test_equal_samples_have_equal_settings():
    none = BoxSample(excitation="none")
    assert BoxSample(excitation="none", amplitude=5.0).settled() == none.settled()
    assert BoxSample(excitation="held", amplitude=5.0).settled() != BoxSample(excitation="held").settled()
    assert asdict(BoxSample().settled()) == asdict(BoxSample())
