"""Interrupts that are never lost: Ctrl-C and SIGTERM end the command wherever they strike.

Python raises them between any two instructions. Where those belong to a callback of the interpreter, such as the
clean-up of a weak reference, it can only report the exception and go on; then it is raised again a moment later.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

TERMINATED = 143
AGAIN = 0.01  # seconds


@contextmanager
def interruptible() -> Iterator[None]:
    """For the time of a ``with``: SIGTERM raises ``SystemExit(143)``, and no interrupt is swallowed.

    A signal that this process was begun to ignore stays ignored.
    """
    swallowed: list[BaseException] = []
    before_hook = sys.unraisablehook

    def terminate(signum: int, frame: FrameType | None) -> None:
        raise SystemExit(TERMINATED)

    def raise_again(signum: int, frame: FrameType | None) -> None:
        if swallowed:
            raise swallowed.pop()

    def hook(lost: UnraisableHookArgs, /) -> None:
        if isinstance(lost.exc_value, (KeyboardInterrupt, SystemExit)):
            swallowed.append(lost.exc_value)
            signal.setitimer(signal.ITIMER_REAL, AGAIN)
        else:
            before_hook(lost)

    handlers = {signal.SIGTERM: terminate, signal.SIGALRM: raise_again}
    if signal.getsignal(signal.SIGTERM) == signal.SIG_IGN:  # as whoever began this process wants it
        del handlers[signal.SIGTERM]
    before = {signum: signal.signal(signum, handler) for signum, handler in handlers.items()}
    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before_hook
        signal.setitimer(signal.ITIMER_REAL, 0)
        for signum, handler in before.items():
            signal.signal(signum, handler)
