"""Whether trajectories come back to the surface they started from, which eigenfunctions from data must not do."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

ONE_LEVEL = 1e-6  # relative spread of the energies of states that count as one level
SHARED = 10  # initial states of each level at least, where levels are surfaces
TOUCH = 1e-3  # of the distance between two samples: a start nearer to the path than that lies on it
NEAR = 0.1  # of the same: a start within so much more than half of it from its middle is looked at closely
TINY = 1e-300
REST = 1e-12  # of the largest state: a trajectory that moves less is at rest


class Surface(NamedTuple):
    """What a plant knows of a surface of one kinetic energy: ``energy(x)`` (n,) in J, ``flow(x)`` = dx/dt (n, n_x)."""

    energy: Callable[[FloatArray], FloatArray]
    flow: Callable[[FloatArray], FloatArray]


class _Return(NamedTuple):
    trajectory: int
    sample: int
    start: int


def check_starts(x: FloatArray) -> int:
    """How many initial states of ``x`` (J, samples, n_x) repeat an earlier one, whose trajectory they share.

    Raises ``InvalidValueError`` where equal states go different ways: then no function of the state is there to find.
    """
    _, first, which = np.unique(x[:, 0], axis=0, return_index=True, return_inverse=True)
    like = first[which.ravel()]
    size = np.abs(x).max()
    for j in np.flatnonzero(like != np.arange(len(x))):
        if np.abs(x[j] - x[like[j]]).max() > 1e-9 * size:
            raise InvalidValueError(
                f"trajectories {like[j]} and {j} start from the same state {_text(x[j, 0])} and go different ways: "
                "leave one out, or add the state in which they differ"
            )
    return int((like != np.arange(len(x))).sum())


def check_recurrence(x: FloatArray, dt: float, surface: Surface | None = None) -> int | None:
    """Raise ``InvalidValueError`` where trajectories ``x`` (J, samples, n_x) come back to their initial states (7.9).

    Initial states of one energy, or of a few, are closed surfaces; every trajectory must leave its own at once and stay
    inside of it. How many there are is returned, or None where the states lie on none. In any case no path may lead
    through an initial state of its own surface.
    """
    levels, of = None, np.zeros(len(x), dtype=np.intp)
    if surface is not None:
        energy = surface.energy(x[:, 0])
        order = np.argsort(energy, kind="stable")
        gaps = np.diff(energy[order]) > ONE_LEVEL * energy.max()
        count = 1 + int(gaps.sum())
        if count == 1 or count * SHARED <= len(x):
            _stay_below(x, dt, surface)
            levels = count
            of[order[1:]] = np.cumsum(gaps)
    for number in np.unique(of):
        members = np.flatnonzero(of == number)
        back = _passes_a_start(x[members])
        if back is not None:
            start = members[back.start]
            raise InvalidValueError(
                f"trajectory {members[back.trajectory]} comes back at {back.sample * dt:g} s to the initial state of "
                f"trajectory {start}, {_text(x[start, 0])}: eigenfunctions need initial states that no trajectory "
                "returns to; shorten the trajectories or choose other initial states"
            )
    return levels


def _stay_below(x: FloatArray, dt: float, surface: Surface) -> None:
    """Refuse a trajectory that keeps its energy at the start, or has it back later."""
    start = x[:, 0]
    level, flow = surface.energy(start), surface.flow(start)
    step = 1e-6 * np.abs(start).max() / max(float(np.abs(flow).max()), TINY)
    power = (surface.energy(start + step * flow) - surface.energy(start - step * flow)) / (2 * step) / level
    held = power > -1e-9 / max(x.shape[1] * dt, TINY)
    again = surface.energy(x[:, 1:]) >= level[:, np.newaxis]
    late = np.asarray(again.any(axis=1))
    if held.any() or late.any():
        j = int(np.argmax(held | late))
        k = 0 if held[j] else int(np.argmax(again[j])) + 1
        what = "does not leave" if k == 0 else "comes back to"
        raise InvalidValueError(
            f"trajectory {j} {what} the surface of equal kinetic energy it starts from, at {k * dt:g} s, from "
            f"{_text(start[j])}: eigenfunctions need a surface that no trajectory returns to; the vehicle must lose "
            "energy (drag, tyres), or choose other initial states"
        )


def _passes_a_start(x: FloatArray) -> _Return | None:
    """The first path that leads through an initial state after its own start, between its samples k and k + 1."""
    from scipy.spatial import cKDTree  # noqa: PLC0415

    scale = np.abs(x).max(axis=(0, 1))
    path = x / np.where(scale > 0, scale, 1.0)
    path = np.concatenate([path, path[:, -1:]], axis=1)  # the last sample is a stretch of no length
    starts = cKDTree(path[:, 0])
    middle = (path[:, :-1] + path[:, 1:]) / 2
    length = np.linalg.norm(path[:, 1:] - path[:, :-1], axis=2)
    reach = np.maximum((0.5 + NEAR) * length, REST)
    distance, _ = starts.query(middle.reshape(-1, x.shape[2]))
    for j, k in np.argwhere(distance.reshape(length.shape) <= reach):  # few: starts lie apart from the paths
        fine = _curve(path[j], int(k))
        for start in sorted(starts.query_ball_point(middle[j, k], reach[j, k])):
            own = k == 0 and (path[start, 0] == path[j, 0]).all()
            if not own and _miss(fine[:-1], fine[1:], path[start, 0]).min() <= max(TOUCH * length[j, k], REST):
                return _Return(int(j), int(k), int(start))
    return None


def _miss(start: FloatArray, stop: FloatArray, goal: FloatArray) -> FloatArray:
    """How far the straight way from ``start`` to ``stop`` (..., n_x) passes ``goal``, (...,)."""
    along, way = stop - start, goal - start
    length = np.linalg.norm(along, axis=-1)
    share = np.clip((way * along).sum(axis=-1) / np.where(length > 0, length, 1.0) ** 2, 0.0, 1.0)
    return np.asarray(np.linalg.norm(share[..., np.newaxis] * along - way, axis=-1))


def _curve(path: FloatArray, k: int) -> FloatArray:
    """The cubic through the four samples around the stretch from k to k + 1, at points along it."""
    count = min(4, len(path))
    first = min(max(k - 1, 0), len(path) - count)
    nodes = np.arange(count)
    s = k - first + np.linspace(0.0, 1.0, 33)
    weights = [np.prod([(s - m) / (n - m) for m in nodes if m != n], axis=0) for n in nodes]
    return np.asarray(np.stack(weights, axis=1) @ path[first : first + count])


def _text(x: FloatArray) -> str:
    return f"[{', '.join(f'{value:.4g}' for value in x)}]"
