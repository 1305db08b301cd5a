"""Bad input: the exit code of its kind, one line, no traceback, nothing written."""

from __future__ import annotations

import errno
import json
import os
import pwd
import subprocess
import sys

import pytest
from filelock import FileLock

from koopcli.__main__ import main
from koopcli.store.identity import SCHEMA

BAD_VEHICLE = '[parameters]\nm = { value = -1300.0, unit = "kg" }\n'


def one_line(result, code, *parts):
    """The failure is its last line on stderr; before it only notes and warnings."""
    assert result.code == code, result.err
    last = result.err.splitlines()[-1]
    assert last.startswith("koop: ")
    assert "Traceback" not in result.err
    for part in parts:
        assert part in last
    assert result.out == ""


@pytest.mark.parametrize(
    ("args", "code", "part"),
    [
        (["fit-edmd", "--ordre", "3"], 2, "--ordre"),
        (["fti-edmd"], 2, "fti-edmd"),
        (["sample", "cube"], 2, "cube"),
        (["sample", "grid", "--draw", "odd"], 2, "odd"),
        (["sample", "grid", "--excitation", "held"], 2, "'sample.excitation' belongs to sample 'box'"),
        (["fit-edmd", "--set", "fit-edmd.degree=3"], 2, "unknown setting 'fit-edmd.degree'"),
        (["fit-edmd", "--set", "nonsense"], 2, "--set stage.key=value"),
        (["fit-edmd", "--order", "x"], 2, "'--order'"),
        (["plot"], 2, "orders"),
        (["plot", "orders", "--set", "fit-edmd.order=3"], 2, "it sweeps reproduce.orders"),
        (["plot", "orders", "--set", "reproduce.draws=['even']"], 2, "sample.draw"),
        (["fit-edmd", "--order", "-1"], 3, "'fit-edmd.order' must be at least 1"),
        (["fit-edmd", "--order", "0"], 3, "'fit-edmd.order' must be at least 1"),
        (
            ["fit-edmd", "--order", "40"],
            3,
            "68,921 functions with 68,925 linear terms and 38.0 GB for them; the limit is 4,096 terms",
        ),
        (["fit-edmd", "--order", "6"], 3, "5 values per state"),
        (["fit-edmd", "--order", "9" * 400], 3, "'fit-edmd.order' must be at most 1000"),
        (["simulate", "--set", "simulate.dt=1" + "0" * 400], 3, "'simulate.dt' must be a finite number"),
        (["sample", "--set", "sample.seed=" + "9" * 5000], 3, "'sample.seed' must be a whole number"),
        (["sample", "--set", "sample.levels=" + "[" * 3000], 3, "nested over 64 levels deep"),
        (["sample", "--set", "sample.kind=[1]"], 2, "'sample' has no kind [1]"),
        (["sample", "--set", "sample.levels=[1e308]"], 3, "'sample.levels[0]' must be at most 1e+12"),
        (["sample", "box", "--count", "100000000"], 3, "the sample would need"),
        (["simulate", "--set", "sample.count=2000"], 3, "the trajectories would need"),
        (["ls", "--vehicle", "x"], 2, "--vehicle"),
        (["sample", "--set", "vehicle.Jzz=5"], 2, "a sample of kind 'grid' does not depend on the vehicle"),
        (
            ["sample", "ball", "--set", "vehicle.rho=5"],
            2,
            "takes m and Jzz of the vehicle alone",
        ),
        (["fit-edmd", "--set", "vehicle.mu_scale=2"], 2, "the plant 'forces' has no use for it"),
        (["evaluate", "--excitation", "none", "--amplitude", "5"], 2, "the excitation 'none' has no use for it"),
        (["fit-edmd", "--set", "vehicle.lateral.mu=2"], 2, "the plant 'forces' has no use for it"),
        (["fit-eigen", "--set", "simulate.force_per=wheel"], 2, "the plant 'slips' has no use for it"),
        (
            ["fit-eigen", "--boundary", "optimal", "--centres", "9"],
            2,
            "'fit-eigen.centres' belongs to boundary 'thin-plate', and this boundary is 'optimal'",
        ),
        (
            ["fit-edmd", "--set", "fit-edmd.basis=states", "--order", "3"],
            2,
            "and this basis is 'states'",
        ),
        (["sample", "ellipsoid", "--count", "440"], 3, "must be a square such as 441 = 21²"),
        (["sample", "ellipsoid", "--draw", "even"], 2, "'sample.draw' belongs to sample 'grid'"),
        (["sample", "ball", "--energy", "0"], 3, "'sample.energy' must be above 0 J"),
        (
            ["simulate", "--plant", "slips", "--set", "sample.kind=grid"],
            3,
            "inputs of the plant 'forces', not of 'slips'",
        ),
        (["fit-eigen", "--tabulate", "0.3"], 3, "leaves nothing of trajectories of 0.3 s"),
        (["fit-eigen", "--tabulate", "0.015"], 3, "whole number of sampling periods of 0.01 s"),
        (["fit-eigen", "--degree", "9"], 3, "220 rates are too many for windows of 30 steps"),
        (["fit-eigen", "--cut", "2"], 3, "'fit-eigen.cut' must be at most 0.5"),
        (["fit-eigen", "--set", "sample.kind=grid"], 3, "an eigenfunction e^(λt) g(x0) belongs to a system that runs"),
        (["fit-eigen", "--set", "sample.kind=box"], 3, "drives its trajectories with inputs that change"),
        (["baseline", "guess"], 2, "guess"),
        (["sample", "grid", "--set", "simulate.dt=0.1"], 2, "simulate.dt changes nothing here"),
        (["fit-eigen", "--set", "sample.grid.count=3"], 2, "no sample of kind 'grid' is used"),
        (["fit-edmd", "--set", "sample.box.count=3"], 2, "no sample of kind 'box' is used"),
        (["sample", "ellipsoid", "--set", "sample.ball.seed=4"], 2, "no sample of kind 'ball' is used"),
        (["evaluate", "--set", "test.ball.count=9"], 2, "no test of kind 'ball' is used"),
        (["evaluate", "--set", "sample.box.count=9"], 2, "no sample of kind 'box' is used"),
        (["plot", "error-map", "--set", "test.box.count=3"], 2, "no test of kind 'box' is used"),
        (["plot", "orders", "--set", "sample.ellipsoid.count=16"], 2, "no sample of kind 'ellipsoid' is used"),
        (["sample", "ball", "--set", "sample.draw=even"], 2, "'sample.draw' belongs to sample 'grid'"),
        (["fit-eigen", "--set", "vehicle.lateral.E=2"], 3, "'vehicle.lateral.E' must be at most 1, got 2"),
        (["sample", "ellipsoid", "--count", "9"], 3, "'sample.count' must be at least 10"),
        (["reproduce", "edmd", "--set", "sample.box.count=5"], 2, "changes nothing in reproduce edmd"),
        (["reproduce", "eigen", "--set", "sample.ball.count=5"], 2, "changes nothing in reproduce eigen"),
        (
            ["reproduce", "--set", "fit-eigen.boundary=optimal", "--set", "fit-eigen.centres=7"],
            2,
            "'fit-eigen.centres' belongs to boundary 'thin-plate', and this boundary is 'optimal'",
        ),
        (["reproduce", "edmd", "--set", "fit-edmd.basis=states"], 3, "which the basis 'states' has none of"),
        (["reproduce", "--set", "sample.count=2"], 2, "say which, sample.grid.count or sample.ellipsoid.count"),
        (["reproduce", "edmd", "--set", "vehicle.mu_scale=2"], 2, "changes nothing in reproduce edmd"),
        (["reproduce", "eigen", "--set", "test.seed=2"], 2, "reproduce.seeds"),
        (["reproduce", "edmd", "--set", "sample.kind=box"], 2, "reproduce has its own sample.kind"),
        (["plot", "error-map", "--set", "fit-edmd.order=3"], 2, "the figure 'error-map' draws nothing of it"),
        (["fit-edmd", "--set", "test.count=7"], 2, "--set test.count changes nothing here"),
        (["simulate", "--vehicle", "~nouser/x.toml"], 3, "~nouser/x.toml"),
        (["simulate", "--vehicle", "x" * 300 + ".toml"], 3, "File name too long"),
        (["sample", "--store", "~nouser/x"], 6, "~nouser/x"),
        (["sample", "--store", "x" * 300], 6, "; give it a shorter path, or choose another store"),
        (["ls", "--store", "x" * 300], 6, "File name too long"),
        (["vehicle", "show", "x" * 300 + ".toml"], 3, "File name too long"),
        (["diff", "x" * 300, "y"], 3, "File name too long"),
        (
            ["plot", "orders", "-o", "x" * 300 + ".png"],
            6,
            "File name too long; give it a shorter path, or name another",
        ),
        (["plot", "orders", "--csv", "x" * 300], 6, "File name too long"),
        (["sample", "grid", "--count", "0"], 3, "'sample.count' must be at least 1"),
        (["sample", "box", "--amplitude", "nan"], 3, "'sample.amplitude' must be a finite number"),
        (["sample", "box", "--amplitude", "-1"], 3, "'sample.amplitude' must be at least 0"),
        (["sample", "--seed", "-1"], 3, "'sample.seed' must be at least 0"),
        (["sample", "--set", "sample.box=[1.0, 2.0]"], 3, "one half-width for each of v_x, v_y, yaw_rate"),
        (["simulate", "--dt", "0"], 3, "'simulate.dt' must be above 0 s"),
        (["simulate", "--dt", "nan"], 3, "'simulate.dt' must be a finite number"),
        (["simulate", "--dt", "inf"], 3, "'simulate.dt' must be a finite number"),
        (["simulate", "--steps", "0"], 3, "'simulate.steps' must be at least 1"),
        (["simulate", "--set", "sample.kind=box", "--set", "sample.steps=3", "--steps", "9"], 3, "inputs for 3 steps"),
        (["evaluate", "--count", "0"], 3, "'test.count' must be at least 1"),
        (["evaluate", "--steps", "0"], 3, "'test.steps' must be at least 1"),
        (["evaluate", "--set", "evaluate.first=9"], 3, "'evaluate.first' must be at most the 5 steps"),
        (["simulate", "--vehicle", "none.toml"], 3, "none.toml: there is no such vehicle file"),
        (["simulate", "--set", "vehicle.m=-1"], 3, "'vehicle.m' must be above 0 kg"),
        (["plot", "orders", "-o", "orders.gif"], 3, "unknown ending"),
        (["simulate", "--vehicle", "ctu"], 4, "unknown vehicle 'ctu': did you mean 'ctu-2020'?"),
        (["fit-edmd", "simulate/abc"], 4, "koop ls"),
        (["evaluate", "abc"], 4, "koop ls"),
        (["plot", "ordres"], 4, "did you mean 'orders'"),
        (["plot", ""], 4, "unknown figure ''"),
        (["show", "abc"], 4, "koop ls"),
        (["ls", "stages"], 4, "fit-edmd"),
    ],
)
def test_bad_input(koop, folder, args, code, part):
    one_line(koop(*args), code, part)
    assert not (folder / "artefacts").exists()


def test_what_takes_too_much_memory(koop, monkeypatch):
    from koopcli.simulation import sampling

    def greedy(*args):
        raise MemoryError("Unable to allocate 1 PiB")

    monkeypatch.setattr(sampling, "box", greedy)
    one_line(koop("sample", "box"), 3, "not enough memory", "lower the count")


def test_a_bad_vehicle_file(koop, folder):
    (folder / "bad.toml").write_text(BAD_VEHICLE)
    one_line(koop("fit-edmd", "--set", "vehicle.name=./bad.toml"), 3, "bad.toml", "'parameters.m' must be above 0 kg")
    assert not (folder / "artefacts").exists()


@pytest.mark.parametrize(
    ("command", "name"), [(["vehicle", "check"], "my.toml"), (["fit-edmd", "--experiment"], "./my.toml")]
)
def test_a_file_of_another_encoding(koop, folder, command, name):
    (folder / name).write_text("title = 'a'", encoding="utf-16")
    one_line(koop(*command, name, tiny=False), 3, "my.toml", "it is UTF-16: save it as UTF-8")


def test_what_a_file_holds_steers_no_terminal(koop, folder):
    from koopcli.config.data import data_folder

    shipped = (data_folder() / "vehicles" / "ctu-2020.toml").read_text()
    about = 'title = "a\\u001b]0;owned\\u0007"\nsource = "x\\u001b[2J"\n'
    (folder / "v.toml").write_text(about + shipped[shipped.index("[parameters]") :])
    (folder / "e.toml").write_text('[fit-edmd]\n"o\\u001b]0;owned\\u0007r" = 1\n')
    checked = koop("vehicle", "check", "v.toml", tiny=False)
    refused = koop("fit-edmd", "--experiment", "./e.toml", tiny=False)
    assert "a�]0;owned�\n" in checked.out
    assert "source: x�[2J\n" in checked.out
    one_line(refused, 3, "fit-edmd.o�]0;owned�r")
    for text in (checked.out, checked.err, refused.err):
        assert text.replace("\n", "").isprintable()


def test_an_unknown_experiment(koop):
    one_line(koop("fit-edmd", "--experiment", "papre", tiny=False), 4, "did you mean 'paper'")


def test_the_wrong_kind_of_artefact(koop):
    sample = koop("sample").name
    one_line(koop("evaluate", sample), 4, "is an artefact of stage sample; the PREDICTOR must be of stage fit-edmd")
    one_line(koop("plot", "orders", sample), 4, "must be of stage evaluate")
    one_line(koop("show", sample, "--csv"), 4, "no table")


def test_a_named_artefact_cannot_be_changed_after_the_fact(koop):
    predictor = koop("fit-edmd").name
    one_line(koop("evaluate", predictor, "--set", "vehicle.Jzz=1731"), 2, "vehicle.Jzz cannot change it")
    one_line(koop("evaluate", "--on", "simulate", "--excitation", "held"), 2, "test.excitation cannot change it")


def test_a_figure_does_not_mix_experiments_in_one_curve(koop, folder):
    """Points of one curve differ in the order alone; others are told apart by what else differs."""
    made = [
        koop("evaluate", "--set", f"fit-edmd.order={order}", "--set", f"vehicle.Jzz={inertia}").name
        for order, inertia in ((1, 1400), (2, 1400), (1, 1731), (2, 1731))
    ]
    assert koop("plot", "orders", *made, "--csv", "both.csv").code == 0
    header = (folder / "both.csv").read_text().splitlines()[0]
    assert "random 0, fresh inputs, Jzz 1400/mean" in header
    assert "random 0, fresh inputs, Jzz 1731/mean" in header
    koop("plot", "orders", made[0], made[3], "--csv", "two.csv")
    assert (folder / "two.csv").read_text().splitlines()[0].count("/mean") == 2
    one_line(koop("plot", "orders", made[0], made[0]), 3, "is named twice")


def test_an_ambiguous_name_lists_the_candidates(koop):
    names = {koop("sample", "--seed", str(seed)).name for seed in (1, 2)}
    result = koop("simulate", "sample")
    one_line(result, 4, "ambiguous", *names)


def test_a_simulation_that_overflows(koop):
    far = ["--set", "sample.kind=box", "--set", "sample.amplitude=1e12", "--dt", "10"]
    one_line(koop("simulate", *far), 3, "lower simulate.dt")


def test_a_damaged_artefact_is_rebuilt_with_a_warning_or_refused(koop, folder):
    predictor = koop("fit-edmd").name
    path = folder / koop("path", predictor).name
    path.write_bytes(path.read_bytes()[:-1])
    rebuilt = koop("evaluate", predictor)
    assert rebuilt.code == 0
    assert "warning: the object of" in rebuilt.err
    assert list((folder / "artefacts" / "quarantine").iterdir())
    path.write_bytes(b"")
    for record in (folder / "artefacts" / "records" / "simulate").iterdir():
        record.unlink()
    one_line(koop("show", predictor), 5, "cannot be made again")


def test_a_damaged_record_is_put_aside(koop, folder):
    name = koop("fit-edmd").name
    (record,) = (folder / "artefacts" / "records" / "fit-edmd").iterdir()
    record.write_text(record.read_text().replace('"order": 2', '"order": 3'))
    again = koop("fit-edmd")
    assert again.code == 0
    assert again.name == name
    assert "damaged and was put aside" in again.err


@pytest.mark.parametrize(
    ("code", "part"),
    [
        (errno.ENOSPC, " free); free some space, or choose another store with --store"),
        (errno.EDQUOT, " free); remove files of yours: they fill your quota, or"),
        (errno.EROFS, "Read-only file system; mount it for writing, or"),
        (errno.EACCES, "Permission denied; change its permissions, or"),
        (errno.EIO, "; look after its disk or its server, or"),
        (errno.EBADF, "Bad file descriptor; choose another store with --store"),
    ],
)
def test_storage_that_fails(koop, folder, monkeypatch, code, part):
    real = os.open

    def failing(path, flags, *args, **kwargs):
        if flags & os.O_CREAT and "artefacts/tmp" in str(path):
            raise OSError(code, os.strerror(code))
        return real(path, flags, *args, **kwargs)

    monkeypatch.setattr(os, "open", failing)
    one_line(koop("sample"), 6, os.strerror(code), part)
    assert not list((folder / "artefacts" / "tmp").iterdir())


def test_a_read_only_store_still_serves_hits(koop, folder, monkeypatch):
    name = koop("fit-edmd").name

    def refuse(*args, **kwargs):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    for call in ("replace", "mkdir", "write", "fsync"):
        monkeypatch.setattr(os, call, refuse)
    assert koop("fit-edmd").name == name
    assert koop("show", name).code == 0


def test_an_unwritable_picture(koop, folder):
    one_line(koop("plot", "orders", "-o", "no/such/folder/x.png"), 6, "no/such/folder")
    assert not (folder / "artefacts").exists()
    (folder / "x.png").mkdir()
    one_line(koop("plot", "orders", "-o", "x.png"), 6, "x.png")
    assert [path.name for path in folder.iterdir()] == ["x.png"]


def test_a_picture_whose_name_is_as_long_as_a_name_can_be(koop, folder):
    name = "x" * 251 + ".png"
    assert koop("plot", "tyre", "-o", name).code == 0
    assert (folder / name).exists()


def test_without_a_home_matplotlib_is_not_left_to_look_for_one(koop, monkeypatch):
    """Below 3.11 it fails with a traceback, as in a container whose user has no name."""
    for name in ("HOME", "MPLCONFIGDIR"):
        monkeypatch.setenv(name, "")  # put back afterwards, whatever happens to it
        monkeypatch.delenv(name)
    monkeypatch.setattr(pwd, "getpwuid", lambda user: {}[user])
    assert koop("plot", "--list").code == 0
    assert os.environ["MPLCONFIGDIR"] == os.devnull


def test_windows_gets_one_sentence(folder):
    """Before a module is imported that Windows does not have."""
    lacking = "import os, sys, pathlib; sys.modules.update(fcntl=None, resource=None); os.name = 'nt'; import koopcli"
    calls = {
        "from koopcli.__main__ import main; sys.exit(main(['sample']))": "koop: ",
        "koopcli.load('sample')": "Error: ",
    }
    for call, before in calls.items():
        done = subprocess.run([sys.executable, "-c", f"{lacking}; {call}"], capture_output=True, text=True, check=False)
        assert done.returncode != 0
        assert f"{before}koop needs the files and locks of Linux or macOS: on Windows, run it in WSL\n" in done.stderr


def test_a_store_that_is_a_file(koop, folder):
    (folder / "x").write_text("")
    one_line(koop("sample", "--store", "x"), 6, "not a folder")


def test_a_lock_that_is_held(koop, folder, monkeypatch):
    monkeypatch.setenv("KOOP_LOCK_TIMEOUT", "0.05")
    koop("sample")
    (record,) = (folder / "artefacts" / "records" / "sample").iterdir()
    record.unlink()
    with FileLock(folder / "artefacts" / "locks" / f"{record.stem}.lock"):
        one_line(koop("sample"), 7, "another process")


def test_a_newer_format(koop, folder):
    koop("sample")
    (record,) = (folder / "artefacts" / "records" / "sample").iterdir()
    record.write_text(json.dumps({**json.loads(record.read_text()), "schema": SCHEMA + 1}))
    one_line(koop("sample"), 8, "update koop")


def test_junk_among_the_records_is_passed_over(koop, folder):
    name = koop("sample").name
    records = folder / "artefacts" / "records"
    (records / "sample" / "notes.json").write_text("{}")
    (records / "sample" / f"{'0' * 64}.json").mkdir()
    (records / "file").write_text("")
    assert koop("sample").name == name
    listed = koop("ls")
    assert name in listed.out
    assert f"the record of sample/{'0' * 12} is damaged and was put aside" in listed.err
    assert (records / "sample" / "notes.json").exists()


def test_a_newer_record_is_passed_over_by_ls(koop, folder):
    name = koop("sample").name
    (record,) = (folder / "artefacts" / "records" / "sample").iterdir()
    other = koop("sample", "--seed", "9").name
    record.write_text(json.dumps({**json.loads(record.read_text()), "schema": SCHEMA + 1}))
    listed = koop("ls")
    assert listed.code == 0
    assert other in listed.out
    assert name not in listed.out
    assert "update koop" in listed.err


def test_a_named_artefact_with_a_damaged_record(koop, folder):
    name = koop("sample").name
    (record,) = (folder / "artefacts" / "records" / "sample").iterdir()
    record.write_text("{}")
    one_line(koop("show", name), 5, "run its command afresh")


def test_an_evaluation_whose_predictor_is_gone_cannot_be_drawn(koop, folder):
    name = koop("evaluate").name
    for path in (folder / "artefacts" / "records" / "fit-edmd").iterdir():
        path.unlink()
    one_line(koop("plot", "orders", name), 4, "the predictor behind evaluate/", "no longer in the store")


def test_inputs_that_never_move_are_a_warning(koop):
    done = koop("fit-edmd", "--set", "sample.columns=1", "--set", "sample.levels=[1.0]", "--json")
    assert done.code == 0
    found = json.loads(done.out)
    assert (found["rank"], found["directions"]) == (27, 27)
    assert "F_fx, F_fy, F_rx, F_ry never moved in these data, so B is zero there" in done.err
    test = koop("evaluate", json.loads(done.out)["name"])
    assert "of which this predictor knows nothing" in test.err


def test_what_cannot_be_read_is_named(koop, folder, monkeypatch):
    name = koop("sample").name
    real = os.open

    def refuse(path, *args, **kwargs):
        if str(path).endswith(".h5"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return real(path, *args, **kwargs)

    monkeypatch.setattr(os, "open", refuse)
    one_line(
        koop("show", name), 6, "cannot read", "Permission denied", ".h5; change its permissions, or choose another"
    )


def test_an_internal_error_is_the_only_traceback(monkeypatch, folder):
    from koopcli.simulation import sampling

    def broken(*args):
        raise ZeroDivisionError

    monkeypatch.setattr(sampling, "grid", broken)
    with pytest.raises(ZeroDivisionError):
        main(["sample"])
