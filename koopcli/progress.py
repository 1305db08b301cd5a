"""Progress is a callback that the caller injects: ``progress(done, total)``."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
FINE = 1000  # parts of one unit that progress inside it is told in


def silent(done: int, total: int) -> None:
    """The callback that says nothing."""


def within(progress: Progress, start: int, stop: int, total: int) -> Progress:
    """The progress of a part of the work, which leads the whole from ``start`` to ``stop`` of ``total``."""

    def inside(done: int, of: int) -> None:
        progress(FINE * start + FINE * (stop - start) * done // max(1, of), FINE * total)

    return inside
