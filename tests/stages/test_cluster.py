"""A real Dask cluster of two workers on loopback: the same results, and a killed worker costs only its chunk."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import time

import pytest

from koopcli import __version__
from koopcli.config.changes import parse_set
from koopcli.config.experiment import load_experiment
from koopcli.errors import InvalidValueError, UsageError
from koopcli.stages import engines, recipes
from koopcli.stages.ahead import make_ahead
from koopcli.stages.engines import Cluster
from koopcli.stages.pipeline import Pipeline
from koopcli.stages.workers import WorkerDiedError, Workers
from koopcli.store import Store
from tests.stages.test_pipeline import Listener

ALONE = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
DATA = ["sample.kind=box", "sample.steps=1", "simulate.chunk=20000"]
PATIENCE = 600  # seconds


class LoopbackCluster:
    """A scheduler and workers without nannies, each one process."""

    def __init__(self, folder) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self._scheduler = self._begin("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", self.file)
        self.workers = []
        for _ in range(2):
            self.add()

    @property
    def address(self) -> str:
        return json.loads(self.file.read_text())["address"]

    def add(self) -> None:
        until(self.file.exists)
        self.workers.append(self._begin("worker", self.address, "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1"))

    def _begin(self, what, *args):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *map(str, args), "--no-dashboard"]
        log = (self.folder / f"{what}.log").open("ab")
        with log:
            return subprocess.Popen(command, cwd=self.folder, env={**os.environ, **ALONE}, stdout=log, stderr=log)

    def end(self) -> None:
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()


def until(true) -> None:
    end = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed")
    from distributed import Client

    folder = tmp_path / "cluster"
    folder.mkdir()
    begun = LoopbackCluster(folder)
    try:
        with Client(begun.address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        yield begun
    finally:
        begun.end()


def fit(*settings):
    return recipes.fit_edmd(load_experiment("paper", parse_set([*DATA, *settings])))


def made(root, task, workers):
    heard = Listener()
    with workers:
        record = Pipeline(Store(root), heard, workers).make(task).record
    return record, heard


@pytest.mark.slow
def test_chunks_and_whole_artefacts_are_the_same_to_the_last_bit(tmp_path, cluster):
    task = fit("sample.count=4000", "fit-edmd.order=3", "fit-edmd.chunk=700")
    alone, _ = made(tmp_path / "alone", task, Workers())
    shared, heard = made(tmp_path / "shared", task, Workers(cluster=cluster.address))
    assert shared.object == alone.object
    assert not heard.warnings
    store = Store(tmp_path / "ahead")
    with Workers(cluster=str(cluster.file)) as workers:  # by the scheduler's file this time
        assert make_ahead(Pipeline(store, Listener(), workers), [task]) == {}
    assert store.record("fit-edmd", alone.key).object == alone.object


@pytest.mark.slow
def test_a_killed_worker_costs_no_more_than_its_chunk(tmp_path, cluster):
    """What was committed before stays as it is, another worker takes over, and the result is the same."""
    settings = ("sample.count=40000", "fit-edmd.order=7", "fit-edmd.chunk=1000")
    root = tmp_path / "store"
    alone, _ = made(tmp_path / "alone", fit(*settings), Workers())
    made(root, fit(*settings).input("trajectories"), Workers())
    chunks = root / "partial" / alone.key
    with command(root, cluster, *settings) as running:
        until(lambda: len(listing(chunks)) > 45)  # among the sums, which are forty
        cluster.workers[0].send_signal(signal.SIGKILL)
        before = listing(chunks)
        after = dict(before)
        while running.poll() is None:
            after |= listing(chunks)
            time.sleep(0.01)
        errors = running.communicate()[1]
    assert running.returncode == 0, errors
    assert len(before) < len(after)
    again = [name for name in before if after[name] != before[name]]
    assert len(again) <= 1  # what it had just committed and not told yet
    numbers = [name.partition("-")[0] for name in after]
    assert len(set(numbers)) == len(numbers)  # no chunk came out in two ways
    assert Store(root).record("fit-edmd", alone.key).object == alone.object


def command(root, cluster, *settings):
    """The fit of ``settings`` as a command on the cluster."""
    words = [word for one in (*DATA, *settings) for word in ("--set", one)]
    options = ["--cluster", cluster.address, "--store", str(root)]
    return subprocess.Popen(
        [sys.executable, "-m", "koopcli", "fit-edmd", *words, *options],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **ALONE},
    )


def listing(chunks):
    """The chunks that are there, each with the number of its file; none once they are joined."""
    found = {}
    try:
        for path in chunks.iterdir():
            found[path.name] = path.stat().st_ino
    except FileNotFoundError:
        pass
    return found


@pytest.mark.slow
def test_what_is_sent_is_small_and_holds_no_array(tmp_path, cluster, monkeypatch):
    sent = []
    real = Workers.submit

    def spy(self, function, job):
        sent.append(pickle.dumps((function, job)))
        return real(self, function, job)

    monkeypatch.setattr(Workers, "submit", spy)
    task = fit("sample.count=4000", "fit-edmd.order=3", "fit-edmd.chunk=700")
    made(tmp_path / "shared", task, Workers(cluster=cluster.address))
    with Workers(cluster=cluster.address) as workers:
        make_ahead(Pipeline(Store(tmp_path / "ahead"), Listener(), workers), [task])
    assert len(sent) > 12
    assert max(map(len, sent)) < 8_000
    assert not any(b"ndarray" in job or b"numpy" in job for job in sent)


@pytest.mark.slow
def test_a_cluster_that_goes_away_is_one_clear_error(tmp_path, cluster):
    def vanish(workers):
        task = fit("sample.count=4000", "fit-edmd.order=3", "fit-edmd.chunk=100")
        pipeline = Pipeline(Store(tmp_path / "shared"), Listener(), workers)
        pipeline.make(task.input("trajectories"))
        workers.begin(pipeline.store.folder())
        cluster.end()
        pipeline.make(task)

    with pytest.raises(WorkerDiedError, match="is gone"), Workers(cluster=cluster.address) as workers:
        vanish(workers)


@pytest.mark.slow
def test_what_is_said_of_a_cluster_that_goes_away_is_one_line(tmp_path, cluster):
    """Dask's own logs and tracebacks stay off stderr."""
    root = tmp_path / "store"
    with command(root, cluster, "sample.count=40000", "fit-edmd.chunk=500") as running:
        until(lambda: len(list(root.glob("partial/*/*"))) > 5)
        cluster.end()
        errors = running.communicate(timeout=PATIENCE)[1]
    assert running.returncode == 3
    lines = [
        line for line in errors.splitlines() if not line.startswith(("store:", "sample/", "simulate/", "warning:"))
    ]
    assert len(lines) == 1, errors
    assert "is gone: begin it again; what is done stays done" in lines[0]


@pytest.mark.slow
def test_a_cluster_without_workers_is_refused(tmp_path, cluster):
    for worker in cluster.workers:
        worker.kill()
        worker.wait()
    from distributed import Client

    with Client(cluster.address, set_as_default=False) as client:
        until(lambda: not client.scheduler_info()["workers"])
    with pytest.raises(InvalidValueError, match="has no workers"):
        Workers(cluster=cluster.address).begin(tmp_path)


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        ({"tcp://w:1": ("0.0.0", True)}, "has koopcli 0.0.0"),
        ({"tcp://w:1": (f"{__version__} with code 0123456789ab", True)}, "with code 0123456789ab, this is"),
        ({"tcp://w:1": (None, False)}, "does not see the store"),
    ],
)
def test_workers_that_are_of_no_use_are_refused(tmp_path, seen, words):
    class Client:
        def run(self, function, root):
            return {name: (code or engines._code(), there) for name, (code, there) in seen.items()}

    found = Cluster("tcp://w:0")
    found._client = Client()
    with pytest.raises(InvalidValueError, match=words):
        found._look(tmp_path)


def test_what_a_worker_sees(tmp_path):
    assert engines._seen_from_here(str(tmp_path)) == (engines._code(), True)
    assert engines._seen_from_here(str(tmp_path / "elsewhere")) == (engines._code(), False)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "", "there/is/none.json"])
def test_where_nothing_listens_is_said_at_once(tmp_path, address):
    pytest.importorskip("distributed")
    begun = time.monotonic()
    with pytest.raises(InvalidValueError, match="no Dask scheduler answers there"):
        Workers(cluster=address).begin(tmp_path)
    assert time.monotonic() - begun < 0.9 * engines.ANSWERS_WITHIN


def test_a_scheduler_file_that_is_too_deep_is_no_scheduler(tmp_path):
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    file.write_text('{"address": "tcp://127.0.0.1:1", "more": ' + "[" * 100_000 + "]" * 100_000 + "}")
    with pytest.raises(InvalidValueError, match="no Dask scheduler answers there"):
        Workers(cluster=str(file)).begin(tmp_path)


def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidValueError, match=r"pip install 'koopcli\[dask\]'"):
        Workers(cluster="tcp://127.0.0.1:1").begin(tmp_path)


def test_two_engines_at_once_are_refused():
    with pytest.raises(UsageError, match="leave out one of them"):
        Workers(2, "tcp://127.0.0.1:1")
