"""Initial states chosen one after another where the data so far leave the largest gap."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from koopcli.progress import Progress, silent
from koopcli.records import FloatArray

BATCH = 16  # chosen together, before the next are simulated
EVERY = 2  # samples of a trajectory, of which one is enough to measure distances from


def fill(
    candidates: FloatArray,
    count: int,
    flow: Callable[[FloatArray], FloatArray],
    usable: int,
    images: Sequence[FloatArray] = (),
    place: Callable[[FloatArray], FloatArray] = lambda x: x,
    progress: Progress = silent,
) -> FloatArray:
    """``count`` of the ``candidates`` (m, n_x): each the farthest from all data that those before it give (7.14).

    ``flow(x0)`` gives trajectories (n, samples, n_x), whose first ``usable`` samples count as data; ``images``: signs
    (n_x,) under which the mirror image of a trajectory is one too. ``place`` are the coordinates of distances.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  (only this design needs it)

    where = place(candidates)
    gap = np.full(len(candidates), np.inf)
    mirrors = [np.ones(candidates.shape[1]), *images]
    chosen: list[int] = [0]
    new = [0]
    while len(chosen) < count:
        data = flow(candidates[new])[:, :usable:EVERY].reshape(-1, candidates.shape[1])
        seen = place(np.concatenate([data * signs for signs in mirrors]))
        np.minimum(gap, cKDTree(seen).query(where)[0], out=gap)
        open_, new = gap.copy(), []
        for _ in range(min(BATCH, count - len(chosen))):
            farthest = int(open_.argmax())
            new.append(farthest)
            for signs in mirrors:
                image = place(candidates[farthest : farthest + 1] * signs)
                np.minimum(open_, np.linalg.norm(where - image, axis=1), out=open_)
        chosen += new
        progress(len(chosen), count)
    return candidates[chosen[:count]]
