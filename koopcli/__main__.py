"""``python -m koopcli`` and the ``koop`` command: one line for every error, one exit code for every kind."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from koopcli.errors import InvalidValueError, KoopError, StorageError
from koopcli.interrupts import TERMINATED, interruptible
from koopcli.paths import require_posix

RESUME = "interrupted: nothing committed is lost; run the same command again to resume"
INTERRUPTED = 130
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    try:
        require_posix()
        with interruptible():
            _streams()
            for name in BLAS_THREADS:  # read when numpy is first imported, here and in workers
                os.environ.setdefault(name, "1")
            if os.path.expanduser("~") == "~":  # without a home matplotlib below 3.11 fails, and nothing but it asks
                os.environ.setdefault("MPLCONFIGDIR", os.devnull)  # no folder: it makes one and removes it
            code = _run(argv)
            sys.stdout.flush()
    except KoopError as error:
        return _fail(str(error), error.exit_code)
    except MemoryError as error:
        return _fail(
            f"not enough memory ({error}): lower the count, the steps or the order", InvalidValueError.exit_code
        )
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as error:
        code = TERMINATED if error.code == TERMINATED else 0  # typer's own exit: whoever read our output has left
    except BrokenPipeError:
        _discard_stdout()
        return 0
    except OSError as error:
        if error.filename is not None or error.errno is None:
            raise
        _discard_stdout()
        return _fail(f"cannot write the output: {error.strerror}", StorageError.exit_code)
    if code in (INTERRUPTED, TERMINATED):
        _fail(RESUME, code)
    return code


def _run(argv: Sequence[str] | None) -> int:
    import typer  # noqa: PLC0415  (inside, so that Ctrl-C while it loads is answered too)

    from koopcli.cli.app import app  # noqa: PLC0415

    try:
        code = app(args=argv, prog_name="koop", standalone_mode=False)
    except typer.Abort:
        return INTERRUPTED
    except typer.TyperException as error:
        return _fail(error.format_message().replace("Value error, ", ""), getattr(error, "exit_code", 2))
    return code if isinstance(code, int) else 0


def _streams() -> None:
    """Output that cannot fail for its encoding, nor for a stream that was closed before we began."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def _discard_stdout() -> None:
    """Let the interpreter's last flush go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fail(text: str, code: int) -> int:
    if text:
        print(f"koop: {' '.join(text.split())}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
