"""Who reads the streams of a command may leave, and the work goes on."""

from __future__ import annotations

import fcntl
import io
import os
import sys
import threading

import pytest

from koopcli.__main__ import main
from koopcli.errors import StorageError
from koopcli.streams import unstoppable


@pytest.fixture
def stream(monkeypatch):
    """Put a descriptor in the place of a stream of this process."""
    opened = []

    def put(name: str, descriptor: int) -> None:
        file = open(descriptor, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
        opened.append((file, descriptor))
        monkeypatch.setattr(sys, name, file)

    yield put
    for file, descriptor in opened:
        file.close()
        os.close(descriptor)


def abandoned() -> int:
    """A pipe whose reader has left."""
    ours, theirs = os.pipe()
    os.close(ours)
    return theirs


def full() -> int:
    return os.open("/dev/full", os.O_WRONLY)


@pytest.mark.parametrize("lost", [abandoned, full])
def test_a_log_that_is_lost_stops_nothing(folder, stream, capsys, lost):
    stream("stderr", lost())
    assert main(["sample", "--experiment", "../tiny.toml"]) == 0
    assert capsys.readouterr().out.startswith("sample/")
    assert main(["sample", "--experiment", ""]) == 4


def test_output_without_a_reader_stops_nothing(folder, stream):
    """As in `koop fit-edmd 2>&1 | head -1`: both streams are one pipe."""
    for name in ("stdout", "stderr"):
        stream(name, abandoned())
    assert main(["fit-edmd", "--experiment", "../tiny.toml"]) == 0
    assert len(list((folder / "artefacts" / "records" / "fit-edmd").iterdir())) == 1


def test_a_verdict_does_not_hang_on_who_reads_it(koop, folder, stream):
    koop("sample")
    next((folder / "artefacts" / "objects").rglob("*.h5")).write_bytes(b"")
    stream("stdout", abandoned())
    assert main(["verify"]) == 5


def test_output_that_cannot_be_kept_is_an_error_once(stream, capsys):
    stream("stdout", full())
    with unstoppable():
        print("x")
        with pytest.raises(StorageError, match="cannot write the output: No space left on device"):
            sys.stdout.flush()
        print("y")
        sys.stdout.flush()


def test_output_waits_for_a_reader_who_is_slow(stream):
    ours, theirs = os.pipe()
    fcntl.fcntl(theirs, fcntl.F_SETFL, fcntl.fcntl(theirs, fcntl.F_GETFL) | os.O_NONBLOCK)
    stream("stdout", theirs)
    text, read = "x" * 300_000, []

    def reader() -> None:
        while sum(map(len, read)) < len(text):
            read.append(os.read(ours, 65536))

    thread = threading.Thread(target=reader)
    with unstoppable():
        thread.start()
        sys.stdout.write(text)
        sys.stdout.flush()
    thread.join()
    os.close(ours)
    assert b"".join(read).decode() == text


def test_streams_without_a_descriptor_and_closed_ones(monkeypatch):
    held = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", held)
    monkeypatch.setattr(sys, "stderr", None)
    with unstoppable():
        print("ü", flush=True)
        print("lost", file=sys.stderr)
    assert held.buffer.getvalue() == b"?\n"
    assert (sys.stdout, sys.stderr) == (held, None)


def test_a_pipe_that_breaks_elsewhere_is_no_success(koop, monkeypatch):
    from koopcli.simulation import sampling

    def broken(*args):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sampling, "grid", broken)
    done = koop("sample")
    assert done.code == 6
    assert done.err.endswith("koop: the operating system refused: Broken pipe\n")
