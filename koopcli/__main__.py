"""``python -m koopcli`` and the ``koop`` command: one line for every error, one exit code for every kind."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

import typer

from koopcli.cli.app import app
from koopcli.errors import InvalidValueError, KoopError

RESUME = "interrupted: nothing committed is lost; run the same command again to resume"
INTERRUPTED, TERMINATED = 130, 143


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        code = app(args=argv, prog_name="koop", standalone_mode=False)
    except KoopError as error:
        return _fail(str(error), error.exit_code)
    except typer.TyperException as error:
        return _fail(error.format_message().replace("Value error, ", ""), getattr(error, "exit_code", 2))
    except MemoryError as error:
        return _fail(
            f"not enough memory ({error}): lower the count, the steps or the order", InvalidValueError.exit_code
        )
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except SystemExit as error:
        code = error.code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader has gone; stay silent at exit
        return 1
    if code in (INTERRUPTED, TERMINATED):
        print(f"koop: {RESUME}", file=sys.stderr)
    return code if isinstance(code, int) else 0


def _fail(text: str, code: int) -> int:
    if text:
        print(f"koop: {' '.join(text.split())}", file=sys.stderr)
    return code


def _terminate(signum: int, frame: FrameType | None) -> None:
    raise SystemExit(TERMINATED)


if __name__ == "__main__":
    sys.exit(main())
