"""Commands under faults: each ends in one clear line and its exit code, and nothing that was committed is lost."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from koopcli.store import Store
from tests.cli.test_processes import KOOP, LONG, PATIENCE, start, wait_for_chunks
from tests.conftest import read_all

WIDE = ["--set", "simulate.chunk=600", "--set", "evaluate.chunk=25"]  # 20 chunks of one, 16 of the other
SHARED = ["evaluate", "--experiment", "../tiny.toml", "--count", "400", "--steps", "30", *WIDE]


def objects(root: Path) -> dict[str, str]:
    store = Store(root)
    return {f"{stage}/{key}": store.record(stage, key).object for stage, key in store.index()}


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> dict[str, str]:
    from tests.conftest import TINY

    folder = tmp_path_factory.mktemp("straight")
    (folder / "tiny.toml").write_text(TINY)
    (folder / "work").mkdir()
    process = start(folder / "work", *SHARED)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    return objects(folder / "work" / "artefacts")


KILLS = (1, 4, 9, 20)  # chunks that are there; the later ones are of later stages, or the process is done before


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_killed_and_run_again_it_ends_the_same_whatever_the_workers(folder, uninterrupted, workers):
    rng = random.Random(workers)
    for there in KILLS:
        process = start(folder, *SHARED, "--workers", str(workers))
        while chunks(folder) < there + rng.randrange(3) and process.poll() is None:
            time.sleep(0.002)
        process.kill()
        process.communicate(timeout=PATIENCE)
    process = start(folder, *SHARED, "--workers", str(workers))
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert "chunks were already there" in err
    assert objects(folder / "artefacts") == uninterrupted
    assert not list((folder / "artefacts" / "partial").iterdir())


@pytest.mark.slow
def test_workers_end_with_the_process_that_began_them(folder):
    process = start(folder, *SHARED, "--workers", "2")
    wait_for_chunks(folder, 1)
    workers = children(process.pid)
    assert len(workers) >= 2
    process.kill()
    process.communicate(timeout=PATIENCE)
    until = time.monotonic() + 20
    while any(map(alive, workers)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(alive, workers))


@pytest.mark.slow
def test_ctrl_c_in_a_terminal_stops_workers_without_a_word_of_theirs(folder):
    process = start(folder, *SHARED, "--workers", "2", start_new_session=True)
    wait_for_chunks(folder, 1)
    workers = children(process.pid)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert err.splitlines()[-1].endswith("run the same command again to resume")
    until = time.monotonic() + 20
    while any(map(alive, workers)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(alive, workers))


def chunks(folder: Path) -> int:
    return len(list((folder / "artefacts" / "partial").glob("*/*.h5")))


def children(pid: int) -> list[int]:
    listed = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = (tuple(map(int, line.split())) for line in listed.splitlines())
    return [child for child, parent in pairs if parent == pid]


def alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.slow
def test_eight_processes_make_one_artefact_once(folder):
    several = [start(folder, "simulate", "--experiment", "../tiny.toml") for _ in range(8)]
    done = [process.communicate(timeout=PATIENCE) for process in several]
    assert [process.returncode for process in several] == [0] * 8
    assert len({out for out, _ in done}) == 1
    made = [line.split()[0] for _, err in done for line in err.splitlines() if "made in" in line]
    assert len(made) == len(set(made)) == 2  # the sample and the trajectories
    assert read_all(folder / "artefacts") == 2


@pytest.mark.slow
def test_another_takes_over_from_one_that_is_killed(folder):
    first = start(folder, *LONG)
    wait_for_chunks(folder, 3)
    second = start(folder, *LONG)
    while "waiting for another process" not in second.stderr.readline():
        assert second.poll() is None
    first.kill()
    first.communicate(timeout=PATIENCE)
    out, err = second.communicate(timeout=PATIENCE)
    assert second.returncode == 0
    assert "chunks were already there" in err
    assert Store(folder / "artefacts").find(out.strip())


WITHOUT_LOCKS = (
    "import sys, errno, os, filelock; from koopcli.__main__ import main\n"
    "def refuse(self, *args, **kwargs): raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))\n"
    "filelock.FileLock.acquire = refuse\n"
    "sys.exit(main(sys.argv[1:]))"
)


@pytest.mark.slow
def test_two_processes_without_locks_end_the_same(folder, uninterrupted):
    command = [sys.executable, "-c", WITHOUT_LOCKS, *SHARED]
    both = [
        subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    done = [process.communicate(timeout=PATIENCE) for process in both]
    assert [process.returncode for process in both] == [0, 0], done
    assert all("this file system has no locks" in err for _, err in done)
    assert objects(folder / "artefacts") == uninterrupted


@pytest.mark.slow
@pytest.mark.parametrize("limit", [3_000, 400_000])
def test_a_limit_on_the_size_of_files(folder, limit):
    """Struck in a small file, and in one that does not go through memory."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    large = "import koopcli.store.image as i, sys; i.IMAGE_LIMIT = 100_000\nfrom koopcli.__main__ import main\n"
    command = [sys.executable, "-c", f"{large}sys.exit(main(sys.argv[1:]))", *SHARED]
    done = subprocess.run(
        command,
        cwd=folder,
        preexec_fn=limited,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 6, done.stderr
    assert done.stderr.splitlines()[-1].startswith("koop: cannot write to the store")
    assert "File too large" in done.stderr
    assert "Traceback" not in done.stderr
    read_all(folder / "artefacts")
    again = start(folder, *SHARED)
    assert again.communicate(timeout=PATIENCE)[1]
    assert again.returncode == 0


@pytest.fixture
def small_disk(tmp_path) -> Iterator[Path]:
    """A file system of 4 MB, where this user may mount one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(disk)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("mounting a small disk takes rights that this user does not have")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


@pytest.mark.slow
def test_a_disk_that_fills_and_one_that_is_read_only(folder, small_disk):
    store = ["--store", str(small_disk / "store")]
    code, err = run(folder, *SHARED, "--count", "1200", *store)
    assert code == 6
    assert "No space left on device" in err
    assert " needed, " in err
    assert "Traceback" not in err
    small = ["evaluate", "--experiment", "../tiny.toml", *store]
    assert run(folder, *small)[0] == 0
    (small_disk / "ballast").write_bytes(bytes(free(small_disk) - 20_000))
    code, err = run(folder, *small, "--seed", "5")  # found full while writing
    assert code == 6
    assert err.splitlines()[-1].startswith("koop: cannot write to the store")
    before = read_all(small_disk / "store")
    (small_disk / "ballast").unlink()
    assert run(folder, *small, "--seed", "5")[0] == 0
    assert read_all(small_disk / "store") > before

    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    assert run(folder, *small) == (0, run(folder, *small)[1])
    for looking in (["ls"], ["verify"], ["gc"]):
        assert run(folder, *looking, *store)[0] == 0
    code, err = run(folder, *small, "--seed", "6")
    assert code == 6
    assert "Read-only file system" in err


def run(folder: Path, *args: str) -> tuple[int, str]:
    process = subprocess.run([*KOOP, *args], cwd=folder, capture_output=True, text=True, check=False)
    return process.returncode, process.stderr


def free(path: Path) -> int:
    about = os.statvfs(path)
    return about.f_bavail * about.f_frsize


@pytest.mark.slow
def test_a_clock_ten_years_off_changes_nothing(folder):
    assert run(folder, "evaluate", "--experiment", "../tiny.toml")[0] == 0
    store = folder / "artefacts"
    (store / "tmp" / f"{os.getpid()}-{'0' * 16}@{os.uname().nodename}").write_text("another process at work")
    kept = objects(store)
    for years in (-10, 10):
        code = (
            "import sys, time; real = time.time; import koopcli.store.provenance as p, datetime as d\n"
            f"shift = {years} * 365.25 * 86400; time.time = lambda: real() + shift\n"
            "class Clock(d.datetime):\n"
            "    @classmethod\n"
            "    def now(cls, tz=None): return d.datetime.fromtimestamp(time.time(), tz)\n"
            "p.datetime = Clock\n"
            "from koopcli.__main__ import main; sys.exit(main(sys.argv[1:]))"
        )
        for args in (
            ["evaluate", "--experiment", "../tiny.toml", "--seed", str(years + 20)],
            ["gc", "--delete"],
            ["ls"],
        ):
            done = subprocess.run(
                [sys.executable, "-c", code, *args], cwd=folder, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stderr
    assert kept.items() <= objects(store).items()
    assert len(objects(store)) > len(kept)
    assert list((store / "tmp").glob(f"{os.getpid()}-*"))


@pytest.mark.parametrize(("said", "used"), [(None, "1"), ("2", "2")])
def test_blas_has_one_thread_unless_the_user_says_otherwise(folder, said, used):
    """The number of threads moves last bits, so they would depend on the number of workers."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    environment |= {"OPENBLAS_NUM_THREADS": said} if said else {}
    command = [*KOOP, "sample", "--experiment", "../tiny.toml"]
    name = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout
    assert Store(folder / "artefacts").find(name.strip()).provenance["blas_threads"] == used
