"""The simulated log with every defect: it is made again as it is kept, and what mends it gives what was driven."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from koopcli.logs import defects
from koopcli.logs.formats import open_table
from koopcli.logs.log import import_log
from koopcli.logs.map import parse_map
from koopcli.logs.suggest import suggest

KEPT = Path(__file__).parents[2] / "data/logs/simulated"


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """What is driven, and the folder that it is written into; it is driven once."""
    drive, folder = defects.drive(), tmp_path_factory.mktemp("log")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(defects, "drive", lambda _: drive)
        defects.write_defective_log(folder)
    return drive, folder


def columns(path: Path) -> list[np.ndarray]:
    table = open_table(path)
    return table.read(range(len(table.names)))


@pytest.mark.slow  # it is simulated again, in seconds
@pytest.mark.parametrize("name", [defects.MOTION, defects.CONTROLS])
def test_it_is_made_again_as_it_is_kept(driven, name):
    made, kept = (folder / name for folder in (driven[1], KEPT))
    assert made.read_text().splitlines()[0] == kept.read_text().splitlines()[0]
    np.testing.assert_allclose(columns(made), columns(kept), rtol=0, atol=1e-6)


def test_it_is_small():
    assert sum(path.stat().st_size for path in KEPT.iterdir()) < 1_500_000


def test_every_defect_is_in_it():
    motion, controls = columns(KEPT / defects.MOTION), columns(KEPT / defects.CONTROLS)
    times, late = motion[0], controls[0]
    assert times[0] > times[-1]  # left over from the last run
    steps = np.diff(times[1:])
    assert np.median(steps) == pytest.approx(0.01)
    assert np.median(np.diff(late)) == pytest.approx(0.02)
    assert steps[steps > 1] == pytest.approx([26.0] * 3)
    assert late[0] - times[1] == pytest.approx(defects.LATE)
    assert (motion[2] == 0).all()  # constant
    rows = (KEPT / defects.CONTROLS).read_text().splitlines()
    assert '"' not in rows[0]
    assert all(row[0] == row[-1] == '"' for row in rows[1:])


@pytest.mark.slow  # as above
def test_what_mends_it_gives_what_was_driven(driven):
    """The map's units, signs, ratio and offset bring back states and inputs, up to noise and rounding."""
    drive, _ = driven
    log_map = parse_map((KEPT / "map.toml").read_text())
    motion, controls = columns(KEPT / defects.MOTION), columns(KEPT / defects.CONTROLS)
    v_x, yaw_rate = log_map.states
    steer, torque = log_map.inputs
    assert (v_x.unit, yaw_rate.unit, steer.unit, torque.unit) == ("km/h", "deg/s", "deg", "N m")
    assert motion[1][1:] / 3.6 == pytest.approx(drive.x[..., 0].ravel(), abs=5 * defects.NOISE / 3.6)
    measured = yaw_rate.sign * np.radians(motion[3][1:])
    assert measured == pytest.approx(drive.x[..., 2].ravel(), abs=np.radians(5 * defects.NOISE))
    assert np.radians(controls[1]) / steer.ratio == pytest.approx(drive.u[..., 0].ravel(), abs=1e-6)
    assert controls[2] == pytest.approx(drive.u[..., 1].ravel(), abs=6e-3)
    starts = controls[0].reshape(4, -1)[:, 0] + log_map.sources[1].offset
    assert starts == pytest.approx(drive.starts)


@pytest.mark.slow  # as above
def test_the_import_with_its_map_is_what_was_driven(driven):
    """Four episodes, of which each row is that of the drive at that time, up to noise; no check has anything to say."""
    drive, _ = driven
    log = import_log(sorted(KEPT.glob("*.csv")), parse_map((KEPT / "map.toml").read_text()))
    episodes = log.episodes
    assert list(episodes.lengths) == [650] * 4
    assert episodes.starts == pytest.approx(drive.starts)
    assert episodes.x[:, 0] == pytest.approx(drive.x[:, :2597:4, 0].ravel(), abs=5 * defects.NOISE / 3.6)
    assert episodes.x[:, 1] == pytest.approx(drive.x[:, :2597:4, 2].ravel(), abs=np.radians(5 * defects.NOISE))
    means = drive.u.reshape(4, 650, 2, 2).mean(axis=2)
    assert episodes.u.reshape(4, 650, 2)[:, :-1] == pytest.approx(means[:, :-1], abs=1e-2, rel=1e-5)
    assert [check.name for check in log.checks if check.verdict in ("warn", "ask")] == []
    assert {"gaps", "first_row"} <= {check.name for check in log.checks if check.verdict == "note"}


def test_a_first_map_leaves_what_the_checks_then_name():
    """No header says that the yaw rate is positive to the right and that one clock runs ahead."""
    files = sorted(KEPT.glob("*.csv"))
    checks = {check.name: check for check in import_log(files, parse_map(suggest(files).text)).checks}
    assert checks["steer_yaw_correlation"].verdict == "ask"
    assert "sign = -1" in checks["steer_yaw_correlation"].hint
    assert checks["steer_yaw_lag"].verdict == "warn"
    assert "offset = -0.2" in checks["steer_yaw_lag"].hint


@pytest.mark.slow  # as above
def test_it_is_varied_enough_to_identify_from(driven):
    x, u = driven[0].x, driven[0].u
    lateral = np.abs(x[..., 0] * x[..., 2])
    assert np.isfinite(x).all()
    assert x[..., 0].min() > 8
    assert 22 < x[..., 0].max() < 25
    assert 2.5 < lateral.max() < 6
    assert u[..., 1].min() < -500 < 500 < u[..., 1].max()


def test_the_command_wants_a_folder():
    result = subprocess.run([sys.executable, "-m", "koopcli.logs.defects"], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert result.stderr.startswith("usage:")
