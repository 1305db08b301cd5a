"""Progress is a callback that the caller injects: ``progress(done, total)``."""

from collections.abc import Callable

Progress = Callable[[int, int], None]


def silent(done: int, total: int) -> None:
    """The callback that says nothing."""
