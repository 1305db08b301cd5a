from __future__ import annotations

import re
import tomllib
from dataclasses import MISSING, fields, replace
from typing import get_args, get_type_hints

import pytest

from koopcli.choices import Choice, choices, names_of
from koopcli.config import settings
from koopcli.config.changes import SECTIONS, flat, parse_set, toml_value
from koopcli.config.data import data_folder
from koopcli.config.declared import DECLARED, KINDS, every_setting
from koopcli.config.experiment import load_experiment
from koopcli.config.settings import About, Baseline, Evaluate, Reproduce, Simulate
from koopcli.errors import InvalidValueError, UnknownNameError, UsageError
from koopcli.koopman.bases.thin_plate import PLACEMENTS, Splines
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.koopman.eigen.fit import FitEigen
from koopcli.koopman.eigen.frames import FRAMES
from koopcli.koopman.eigen.windows import Ahead
from koopcli.koopman.scores.baselines import FORECASTS
from koopcli.simulation.manoeuvres import MANOEUVRES, ManoeuvreName
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.drive import DriveSample, DriveTestSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.simulation.samples.greedy import GreedySample
from koopcli.simulation.samples.grid import GridSample
from koopcli.simulation.samples.manoeuvre import ManoeuvreSample
from koopcli.simulation.samples.sample import INPUTS, Excitation
from koopcli.simulation.sampling import DRAWS, MESHES
from koopcli.stages.fits import LIFTED
from koopcli.vehicles.plants import PLANTS
from koopcli.vehicles.plants.forces import WHEELS_PER_FORCE, Forces
from koopcli.vehicles.plants.slips import Slips
from koopcli.vehicles.symmetry import MIRRORS, Mirror

PAPER = tomllib.loads((data_folder() / "experiments" / "paper.toml").read_text())


@pytest.mark.parametrize(
    ("literal", "registry"),
    [
        (get_type_hints(GridSample)["draw"], DRAWS),
        (get_type_hints(Forces)["force_per"], WHEELS_PER_FORCE),
        (get_type_hints(Splines)["placement"], PLACEMENTS),
        (ManoeuvreName, MANOEUVRES),
        (Excitation, INPUTS),
        (get_type_hints(EllipsoidSample)["mesh"], MESHES),
        (get_type_hints(Ahead)["coordinates"], FRAMES),
        (Mirror, MIRRORS),
        (settings.BaselineKind, FORECASTS),
        (settings.FitName, LIFTED),
    ],
)
def test_option_names_are_the_registries(literal, registry):
    assert set(get_args(literal)) == set(registry)


def test_a_setting_is_of_one_choice_alone():
    """Settings of kinds are named without them, so that no two choices of a section may have the same."""
    for cls in (FitEdmd, FitEigen, Simulate):
        names = [{n for kind in base.kinds().values() for n in names_of(kind)} for base in choices(cls).values()]
        own = {f.name for f in fields(cls)}
        assert sum(map(len, names)) + len(own) == len(set().union(own, *names))


def test_the_paper_file_writes_out_every_default():
    """`paper.toml` and the defaults in the code are one thing said twice; neither may drift."""
    loaded = load_experiment("paper", {})
    vehicle = loaded.vehicle
    assert loaded.sample("grid") == GridSample()
    assert loaded.test("box", vehicle) == BoxSample()
    body = {"m": vehicle.m, "Jzz": vehicle.Jzz}
    assert loaded.sample("ellipsoid") == EllipsoidSample(**body)
    assert loaded.test("ball", vehicle) == BallSample(**body)
    simulation = {"vehicle": Slips.used(vehicle), "dt": 0.01, "v_eps": 0.1, "combined": "none"}
    assert loaded.sample("greedy") == GreedySample(**simulation)
    assert loaded.sample("drive") == DriveSample(r_w=vehicle.r_w)
    assert loaded.test("drive-test", vehicle) == DriveTestSample(r_w=vehicle.r_w)
    assert loaded.sample("manoeuvre") == ManoeuvreSample(vehicle=vehicle, dt=0.01)
    assert loaded.about == About()
    assert loaded.fit_edmd == FitEdmd()
    assert loaded.fit_eigen == FitEigen()
    assert loaded.evaluate == Evaluate()
    assert loaded.reproduce == Reproduce()
    assert loaded.simulate == Simulate(vehicle=loaded.simulate.vehicle)
    assert loaded.baseline == Baseline(**PAPER["baseline"])
    assert [loaded.plant_for(kind) for kind in PLANTS.values()] == [kind() for kind in PLANTS.values()]
    assert set(PAPER) == set(SECTIONS)


def test_the_paper_file_names_every_setting_of_the_paper_that_is_not_left_open():
    """What is in effect, that is; other kinds may be left out, so that a new one is one file."""
    said = {name for name, _ in flat(PAPER)}
    in_effect = {*DECLARED, *(f"{section}.{kind}" for section in KINDS for kind in PAPER[section])} - {"vehicle"}
    for declared in every_setting():
        default = declared.field.default
        if declared.table in in_effect and default is not None and default is not MISSING:
            assert {declared.full_name, f"{declared.full_name}.kind"} & said, declared.full_name
        if declared.table in in_effect and isinstance(default, Choice):
            in_effect.add(f"{declared.full_name}.{default.kind}")


def test_every_setting_has_a_help_text():
    assert all(declared.field.metadata["help"] for declared in every_setting())


def test_the_command_line_is_laid_over_the_file():
    changed = load_experiment("smoke", parse_set(["vehicle.Jzz=1731", "sample.seed=3", "fit-edmd.order=2"]))
    assert changed.simulate.vehicle.Jzz == 1731.0
    sample = changed.sample("grid")
    assert (sample.seed, sample.count) == (3, 7)  # the count is the smoke file's
    assert changed.fit_edmd.basis.order == 2


def test_a_change_of_kind_starts_afresh():
    assert load_experiment("paper", parse_set(["sample.kind=box"])).sample("grid") == BoxSample()
    changed = load_experiment("paper", parse_set(["sample.kind=box", "sample.count=9"])).sample("ellipsoid")
    assert changed == BoxSample(count=9)


def test_a_setting_without_a_table_holds_for_the_kind_in_use(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[sample]\ncount = 16\n[sample.grid]\nseed = 5\n")
    mine = load_experiment(str(path), {})
    assert (mine.sample("grid").count, mine.sample("grid").seed) == (16, 5)
    assert mine.sample("ellipsoid").count == 16
    assert load_experiment(str(path), parse_set(["sample.count=9"])).sample("grid").count == 9
    assert load_experiment(str(path), parse_set(["sample.grid.count=9"])).sample("grid").count == 9


def test_a_sample_by_energy_follows_the_vehicle():
    changed = load_experiment("paper", parse_set(["vehicle.m=1000"]))
    assert changed.sample("ellipsoid").m == 1000.0
    other = load_experiment("paper", {}).vehicle
    assert changed.test("ball", other).m == other.m  # of the vehicle that is tested
    with pytest.raises(UsageError, match=r"'sample.m' is the vehicle's: set vehicle.m"):
        load_experiment("paper", parse_set(["sample.m=1000"]))


def test_single_coefficients_of_a_tyre():
    changed = load_experiment("paper", parse_set(["vehicle.lateral.mu=0.9", "vehicle.mu_scale=2"])).vehicle
    assert (changed.lateral.mu, changed.lateral.B, changed.mu_scale) == (0.9, 8.11, 2.0)
    with pytest.raises(UsageError, match=r"unknown setting 'vehicle.lateral.mo'"):
        load_experiment("paper", parse_set(["vehicle.lateral.mo=0.9"]))


def test_another_vehicle_keeps_what_the_command_line_changes():
    changed = load_experiment("paper", parse_set(["vehicle.Jzz=1731", "vehicle.name=ctu-2020"]))
    assert changed.vehicle_name == "ctu-2020"
    beside = changed.with_vehicle("rimac-2018").vehicle
    assert (beside.Jzz, beside.lateral.mu) == (1731.0, 0.9689)


@pytest.mark.parametrize("plant", PLANTS.values())
def test_the_samples_of_a_plant_are_meant_for_it(plant):
    for section, kind in (("sample", plant.training), ("test", plant.test)):
        assert issubclass(plant, KINDS[section][kind].meant_for)


def test_a_choice_may_be_made_beside_its_tables():
    for told in (
        ["fit-edmd.basis=thin-plate", "fit-edmd.basis.thin-plate.centres=9"],
        ["fit-edmd.basis.thin-plate.centres=9", "fit-edmd.basis=thin-plate"],
        ["fit-edmd.basis.kind=thin-plate", "fit-edmd.centres=9"],
    ):
        assert load_experiment("paper", parse_set(told)).fit_edmd.basis == Splines(9)
    for told, says in (
        (["fit-edmd.basis.thin-plate.centres=0"], "'fit-edmd.basis.thin-plate.centres' must be at least 1"),
        (["fit-edmd.basis.thin-plate.order=1"], "'fit-edmd.basis.thin-plate.order' belongs to basis 'tensor'"),
        (["fit-edmd.order=3", "fit-edmd.order.x=3"], "'order' is given a value of its own as well"),
    ):
        with pytest.raises((UsageError, InvalidValueError), match=re.escape(says)):
            load_experiment("paper", parse_set(told))


def test_what_a_plant_does_not_use_is_not_in_its_key():
    vehicle = load_experiment("paper", {}).vehicle
    slippery = replace(vehicle, mu_scale=0.5, lateral=None)
    assert Forces.used(vehicle) == Forces.used(slippery) != vehicle
    slips = Simulate(vehicle=vehicle).settled(Slips(), 10)
    assert slips.vehicle.lateral == vehicle.lateral
    assert slips == Simulate(vehicle=replace(vehicle, r_w=0.4)).settled(Slips(), 10)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (".5", 0.5),
        ("-5.e1", -50.0),
        ("007", 7),
        ("[.5, 2.]", [0.5, 2.0]),
        ("./2020.5", "./2020.5"),
        ("car-2020.toml", "car-2020.toml"),
        ('"a .5"', "a .5"),
    ],
)
def test_numbers_are_also_read_as_options_take_them(text, value):
    assert toml_value(text) == value


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
        ("[sample]\nkind = 'cube'", "'sample' has no kind 'cube'"),
        ("[sample.cube]\nseed = 1", "'sample' has no kind 'cube'"),
        ("[sample]\ngrid = 3", "'sample.grid' must be a table of settings, got 3"),
        (
            "[sample.grid]\nenergy = 3.0",
            "'sample.grid.energy' belongs to sample 'ball' or 'ball-forces' or 'ellipsoid' or 'greedy'",
        ),
        ("[sample.ball]\ncount = 0", "'sample.ball.count' must be at least 1"),
        ("[test.ball]\nm = 3", "'test.ball.m' is the vehicle's: set vehicle.m"),
        ("[sample]\nkind = ['grid']", "'sample' has no kind ['grid']"),
        ("[sample]\nbox = [1e13, 1.0, 1.0]", "'sample.box[0]' must be at most 1e+12"),
        ("[reproduce]\norders = [3, 3]", "'reproduce.orders' names a value twice"),
        ("[simulate.vehicle]\nm = 1.0", "'simulate.vehicle' is the vehicle's: choose it by vehicle.name"),
        ("[test]\ncount = 0", "'test.count' must be at least 1"),
        ("[test]\nkind = 'grid'", "'test' has no kind 'grid'"),
        ("[vehicle]\nJzz = -1", "'vehicle.Jzz' must be above 0"),
        ("sample = 3", "must stand in a table"),
        ("[sample", "cannot read"),
        (
            "[fit-edmd]\nbasis = 'total'\n[fit-edmd.basis.total]\norder = 2",
            'such as kind = "total" in [fit-edmd.basis]',
        ),
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
    with pytest.raises(UnknownNameError, match=r"known: best-edmd, best-eigen, paper, quick-eigen, smoke"):
        load_experiment("papre", {})


def test_equal_samples_have_equal_settings():
    none = BoxSample(excitation="none")
    assert BoxSample(excitation="none", amplitude=5.0).settled() == none.settled()
    assert BoxSample(excitation="held", amplitude=5.0).settled() != BoxSample(excitation="held").settled()
    assert BoxSample().settled() == BoxSample()
