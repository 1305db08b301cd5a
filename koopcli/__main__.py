"""``python -m koopcli`` and the ``koop`` command: one line for every error, one exit code for every kind."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence

from koopcli.errors import InvalidValueError, KoopError, StorageError
from koopcli.interrupts import TERMINATED, interruptible
from koopcli.paths import require_posix
from koopcli.streams import unstoppable
from koopcli.text import one_line

RESUME = "interrupted: nothing committed is lost; run the same command again to resume"
INTERRUPTED = 130
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    with unstoppable():
        code = _answer(lambda: _run(argv))
        return code or _answer(_flush)


def _answer(work: Callable[[], int]) -> int:
    """The exit code of ``work``, after one line for what went wrong."""
    try:
        require_posix()
        with interruptible():
            code = work()
    except KoopError as error:
        return _fail(str(error), error.exit_code)
    except MemoryError as error:
        return _fail(
            f"not enough memory ({error}): lower the count, the steps or the order", InvalidValueError.exit_code
        )
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 0  # SIGTERM; typer, after completing a command line
    except OSError as error:
        if error.filename is not None or error.errno is None:
            raise
        return _fail(f"the operating system refused: {error.strerror}", StorageError.exit_code)
    if code in (INTERRUPTED, TERMINATED):
        _fail(RESUME, code)
    return code


def _run(argv: Sequence[str] | None) -> int:
    for name in BLAS_THREADS:  # read when numpy is first imported, here and in workers
        os.environ.setdefault(name, "1")
    if os.path.expanduser("~") == "~":  # without a home matplotlib below 3.11 fails, and nothing but it asks
        os.environ.setdefault("MPLCONFIGDIR", os.devnull)  # no folder: it makes one and removes it
    import typer  # noqa: PLC0415  (inside, so that Ctrl-C while it loads is answered too)

    from koopcli.cli.app import root  # noqa: PLC0415

    try:
        code = root()(args=argv, prog_name="koop", standalone_mode=False)
    except typer.Abort:
        return INTERRUPTED
    except typer.TyperException as error:
        return _fail(error.format_message().replace("Value error, ", ""), getattr(error, "exit_code", 2))
    except SystemExit as error:
        broken = error.__context__
        if error.code != TERMINATED and isinstance(broken, BrokenPipeError):  # which typer ends in silence
            raise broken from None
        raise
    return code if isinstance(code, int) else 0


def _flush() -> int:
    sys.stdout.flush()
    return 0


def _fail(text: str, code: int) -> int:
    if text:
        print(f"koop: {one_line(text)}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
