from __future__ import annotations

import pytest

from koopcli.checks import COMMAND_LINE
from koopcli.config.data import data_folder, locate
from koopcli.errors import InvalidValueError
from koopcli.vehicles.parameters import change, read_vehicle

GOOD = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()


def test_the_default_vehicle(vehicle):
    # the authors' published TwinTrack model
    assert (vehicle.m, vehicle.Jzz, vehicle.l_f, vehicle.l_r) == (1300.0, 1400.0, 1.3725, 1.3725)
    assert (vehicle.c_w, vehicle.A, vehicle.rho) == (0.18, 2.0, 1.22)


@pytest.mark.parametrize("path", sorted((data_folder() / "vehicles").glob("*.toml")), ids=lambda p: p.stem)
def test_every_shipped_vehicle_reads_and_names_its_source(path):
    read_vehicle(path)
    assert "source" in path.read_text()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("m    = { value = 1300.0", "mass = { value = 1300.0", "unknown key 'parameters.mass'"),
        ('Jzz  = { value = 1400.0, unit = "kg m^2" }', "", "missing key 'parameters.Jzz'"),
        ("value = 1300.0", "value = -1300.0", "'parameters.m' must be above 0 kg"),
        ("value = 1300.0", "value = nan", "'parameters.m' must be a finite number"),
        ("value = 1300.0", "value = true", "'parameters.m' must be a number"),
        ("value = 1300.0", 'value = "heavy"', "'parameters.m' must be a number"),
        ('1300.0, unit = "kg"', '1300.0, unit = "lb"', "'parameters.m' must be given in 'kg', got unit 'lb'"),
        ('{ value = 1300.0, unit = "kg" }', "1300.0", "must be written as m = "),
        ("[parameters]", "[parametres]", "unknown key 'parametres'"),
        ("[parameters]", "[parameters", "not valid TOML"),
    ],
)
def test_a_bad_vehicle_file_is_refused_by_file_and_key(tmp_path, old, new, says):
    assert old in GOOD
    path = tmp_path / "mine.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InvalidValueError) as caught:
        read_vehicle(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_file_that_is_not_text(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidValueError, match="cannot read"):
        read_vehicle(path)
    with pytest.raises(InvalidValueError, match="no such vehicle file"):
        locate("vehicles", str(tmp_path / "none.toml"), "vehicle")


def test_single_parameters_change(vehicle):
    assert change(vehicle, {"Jzz": 1731}, COMMAND_LINE).Jzz == 1731.0
    with pytest.raises(InvalidValueError, match=r"'vehicle\.m' must be above 0"):
        change(vehicle, {"m": -1.0}, COMMAND_LINE)


def test_the_documented_schema_is_the_one_that_is_checked():
    from dataclasses import fields
    from pathlib import Path

    from koopcli.vehicles.parameters import TYRES, MagicFormula, VehicleParameters

    text = (Path(__file__).parents[2] / "docs" / "vehicles.md").read_text()
    body = [("parameters", f) for f in fields(VehicleParameters) if f.name not in TYRES]
    for table, f in (*body, *(("lateral", f) for f in fields(MagicFormula))):
        row = next(line for line in text.splitlines() if line.startswith(f"| {table}.{f.name} |"))
        assert f"| {f.metadata['unit']} |" in row
        assert f.metadata["help"] in row
    assert all(f"[{name}]" in text for name in TYRES)
