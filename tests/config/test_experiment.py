from __future__ import annotations

import tomllib
from dataclasses import asdict, fields, replace
from typing import get_args, get_type_hints

import pytest

from koopcli.config import driving, plants, sampled, samples, settings
from koopcli.config.changes import SECTIONS, parse_set, toml_value
from koopcli.config.data import data_folder
from koopcli.config.experiment import load_experiment
from koopcli.config.pictures import PlotOptions
from koopcli.config.samples import SAMPLES, BoxSample, GridSample
from koopcli.config.settings import About, Baseline, Evaluate, FitEdmd, FitEigen, Reproduce, Simulate
from koopcli.errors import InvalidValueError, UnknownNameError, UsageError
from koopcli.koopman.bases import BASES
from koopcli.koopman.bases.thin_plate import PLACEMENTS
from koopcli.koopman.eigen.frames import FRAMES
from koopcli.koopman.eigen.lookup import LOOKUPS
from koopcli.koopman.eigen.rates import RATES
from koopcli.koopman.scores.baselines import FORECASTS
from koopcli.simulation.manoeuvres import MANOEUVRES
from koopcli.simulation.sampling import DRAWS, MESHES
from koopcli.stages.makers import LIFTED
from koopcli.vehicles.axles import COMBINED
from koopcli.vehicles.options import CUSTOMARY
from koopcli.vehicles.plants import PLANTS
from koopcli.vehicles.single_track import WHEELS_PER_FORCE
from koopcli.vehicles.symmetry import MIRRORS

PAPER = tomllib.loads((data_folder() / "experiments" / "paper.toml").read_text())


@pytest.mark.parametrize(
    ("literal", "registry"),
    [
        (sampled.Draw, DRAWS),
        (plants.PlantName, PLANTS),
        (settings.ForcePer, WHEELS_PER_FORCE),
        (settings.BasisName, BASES),
        (settings.BasisName, settings.OF_BASIS),
        (settings.Placement, PLACEMENTS),
        (sampled.Kind, samples.SAMPLES),
        (sampled.Kind, samples.SAMPLED_FOR),
        (plants.PlantName, samples.CUSTOMS),
        (plants.PlantName, plants.UNUSED),
        (plants.PlantName, CUSTOMARY),
        (settings.Combined, COMBINED),
        (driving.ManoeuvreName, MANOEUVRES),
        (sampled.Excitation, sampled.INPUTS),
        (sampled.Mesh, MESHES),
        (settings.LiftName, LOOKUPS),
        (settings.Eigenvalues, RATES),
        (settings.Coordinates, FRAMES),
        (sampled.Mirror, MIRRORS),
        (settings.BaselineKind, FORECASTS),
        (settings.FitName, LIFTED),
    ],
)
def test_option_names_are_the_registries(literal, registry):
    assert set(get_args(literal)) == set(registry)


def test_defaults_said_twice_agree():
    """Settings are known without the numerics, which have the same numbers for whoever calls them."""
    assert {k: kind.neighbours for k, kind in LOOKUPS.items() if kind.neighbours is not None} == settings.NEIGHBOURS


def test_the_paper_file_writes_out_every_default():
    """`paper.toml` and the defaults in the code are one thing said twice; neither may drift."""
    loaded = load_experiment("paper", {})
    vehicle = loaded.vehicle
    assert loaded.sample("grid") == GridSample()
    assert loaded.test("box", vehicle) == BoxSample()
    body = {"m": vehicle.m, "Jzz": vehicle.Jzz}
    assert loaded.sample("ellipsoid") == SAMPLES["ellipsoid"](**body)
    assert loaded.test("ball", vehicle) == SAMPLES["ball"](**body)
    simulation = {"vehicle": vehicle, "dt": 0.01, "v_eps": 0.1}
    assert loaded.sample("greedy") == SAMPLES["greedy"](**simulation).settled()
    rolling = {"r_w": vehicle.r_w}
    assert loaded.sample("drive") == SAMPLES["drive"](**rolling)
    assert loaded.test("drive-test", vehicle) == SAMPLES["drive-test"](**rolling)
    assert loaded.sample("manoeuvre") == SAMPLES["manoeuvre"](vehicle=vehicle, dt=0.01).settled()
    assert loaded.about == About()
    assert loaded.fit_edmd == FitEdmd()
    assert loaded.fit_eigen == FitEigen()
    assert loaded.evaluate == Evaluate()
    assert loaded.reproduce == Reproduce()
    assert loaded.simulate == Simulate(vehicle=loaded.simulate.vehicle)
    for section, kind in (
        ("sample", "grid"),
        ("sample", "ellipsoid"),
        ("sample", "greedy"),
        ("test", "box"),
        ("test", "point"),
        ("test", "ball"),
        ("sample", "drive"),
        ("sample", "manoeuvre"),
        ("test", "drive-test"),
    ):
        left = {f.name for f in fields(SAMPLES[kind]) if f.default is None}
        assert (
            set(PAPER[section][kind]) == {f.name for f in fields(SAMPLES[kind])} - {"kind", *samples.ELSEWHERE} - left
        )
    for section, cls in {"fit-edmd": FitEdmd, "fit-eigen": FitEigen, "evaluate": Evaluate}.items():
        assert set(PAPER[section]) == {f.name for f in fields(cls) if f.default is not None}
    assert set(PAPER["reproduce"]) == {f.name for f in fields(Reproduce)}
    assert loaded.baseline == Baseline(**PAPER["baseline"])
    assert set(PAPER) == set(SECTIONS)


def test_every_setting_has_a_help_text():
    for cls in (*SAMPLES.values(), About, FitEdmd, FitEigen, Baseline, Evaluate, PlotOptions, Simulate, Reproduce):
        hints = get_type_hints(cls)
        for f in fields(cls):
            if f.name not in ("kind", *samples.ELSEWHERE) or (cls is Simulate and f.name != "vehicle"):
                assert f.metadata["help"], (cls.__name__, f.name, hints[f.name])


def test_the_command_line_is_laid_over_the_file():
    changed = load_experiment("smoke", parse_set(["vehicle.Jzz=1731", "sample.seed=3", "fit-edmd.order=2"]))
    assert changed.simulate.vehicle.Jzz == 1731.0
    sample = changed.sample("grid")
    assert (sample.seed, sample.count) == (3, 7)  # the count is the smoke file's
    assert changed.fit_edmd.order == 2


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


def test_what_a_plant_does_not_use_is_not_in_its_key():
    vehicle = load_experiment("paper", {}).vehicle
    forces = Simulate(vehicle=vehicle, plant="forces")
    slippery = Simulate(vehicle=replace(vehicle, mu_scale=0.5, lateral=None), plant="forces", v_eps=1.0)
    assert forces.settled() == slippery.settled()
    slips = Simulate(vehicle=vehicle, plant="slips", force_per="wheel")
    assert slips.settled() == Simulate(vehicle=vehicle, plant="slips").settled()
    assert slips.settled().vehicle.lateral == vehicle.lateral
    assert FitEigen(boundary="optimal", centres=5, seed=3).settled() == FitEigen(boundary="optimal").settled()
    assert FitEigen().settled() == FitEigen(cut=1e-14)


def test_values_are_toml_or_plain_text():
    parsed = parse_set(["sample.levels=[1, 2]", "sample.draw=even", "test.amplitude = 1e3", 'vehicle.name="x"'])
    assert parsed == {
        "sample": {"levels": [1, 2], "draw": "even"},
        "test": {"amplitude": 1e3},
        "vehicle": {"name": "x"},
    }
    assert parse_set(["vehicle.m=1\na=2"]) == {"vehicle": {"m": "1\na=2"}}  # one value, not two lines of TOML


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
        ("[sample]\nkind = 'cube'", "unknown kind of sample 'cube'"),
        ("[sample.cube]\nseed = 1", "unknown kind of sample 'cube'"),
        ("[sample]\ngrid = 3", "unknown setting 'sample.grid'"),
        ("[sample.grid]\nenergy = 3.0", "'sample.grid.energy' belongs to kind 'ellipsoid'"),
        ("[sample.ball]\ncount = 0", "'sample.ball.count' must be at least 1"),
        ("[test.ball]\nm = 3", "'test.ball.m' is the vehicle's: set vehicle.m"),
        ("[sample]\nkind = ['grid']", "unknown kind of sample ['grid']"),
        ("[sample]\nbox = [1e13, 1.0, 1.0]", "'sample.box[0]' must be at most 1e+12"),
        ("[reproduce]\norders = [3, 3]", "'reproduce.orders' names a value twice"),
        ("[simulate.vehicle]\nm = 1.0", "the vehicle has a section of its own"),
        ("[test]\ncount = 0", "'test.count' must be at least 1"),
        ("[test]\nkind = 'grid'", "unknown kind of test 'grid'"),
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
    with pytest.raises(UnknownNameError, match=r"known: best-edmd, best-eigen, paper, smoke"):
        load_experiment("papre", {})


def test_equal_samples_have_equal_settings():
    none = BoxSample(excitation="none")
    assert BoxSample(excitation="none", amplitude=5.0).settled() == none.settled()
    assert BoxSample(excitation="held", amplitude=5.0).settled() != BoxSample(excitation="held").settled()
    assert asdict(BoxSample().settled()) == asdict(BoxSample())
