"""Objects that stand in for those over 32 MiB: laid out in a file, verified slab by slab, read where a stage reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from unittest.mock import patch

from koopcli.store import digests, image


@contextmanager
def large_from(size: int, slab: int = 1 << 10) -> Iterator[None]:
    """Take every object over ``size`` bytes for a large one, of slabs of ``slab`` bytes, for the time of a ``with``.

    A store written so is read so alone.
    """
    with ExitStack() as stack:
        for module, limit in ((digests, "WHOLE"), (image, "IMAGE_LIMIT"), (image, "MEMORY_LIMIT")):
            stack.enter_context(patch.object(module, limit, size))
        stack.enter_context(patch.object(digests, "SLAB", slab))
        yield
