"""How lifted states move on: x̂_k for many trajectories at once, for every kind of input terms (docs/equations.md 4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from koopcli.koopman.predictor.lifts import Observables
from koopcli.koopman.predictor.modes import Modes
from koopcli.progress import Progress, silent
from koopcli.records import FloatArray

SEGMENT = 128  # steps whose responses are formed together
ROLLED = 1024  # trajectories whose lifted states are rolled together
MOST_TERMS = 64  # of Taylor's series; a step that needs more leaves the finite numbers anyway

Seen = Callable[[FloatArray], FloatArray]  # rows (R, N) to what they see of the lifted states, (n, R)


def linear(
    lift: Observables, A: FloatArray | Modes, B: FloatArray, C: FloatArray, x0: FloatArray, u: FloatArray
) -> FloatArray:
    """x̂_k = C A^k ψ(x_0) + Σ_i C A^(k-1-i) B u_i (4.3), (n, steps+1, n_x), for ``x0`` (n, n_x), ``u`` (n, steps, n_u).

    Up to as many steps as there are lifted states, or ``SEGMENT``, only the n_x rows of C A^k are formed, and ψ(x_0)
    need not be. More steps are cut into equal stretches no longer than that, whose first lifted states follow from one
    another (4.11); each is then predicted like a trajectory of its own. So time and memory grow as the steps. Such a
    stretch is long enough for A^length to cost about what its rows do.
    """
    n, steps, n_u = u.shape
    stretches = -(-steps // max(SEGMENT, len(A)))
    if stretches <= 1:
        return _response(lambda rows: lift.observe(x0, rows), A, B, C, u)
    length = -(-steps // stretches)
    inputs = np.zeros((n, stretches * length, n_u))
    inputs[:, :steps] = u
    z = _starts(lift.lift(x0), A, B, inputs.reshape(n, stretches, length, n_u)).reshape(n * stretches, len(A))
    parts = _response(lambda rows: z @ rows.T, A, B, C, inputs.reshape(n * stretches, length, n_u))
    parts = parts.reshape(n, stretches, length + 1, len(C))
    x = np.empty((n, steps + 1, len(C)))
    x[:, :-1] = parts[:, :, :-1].reshape(n, stretches * length, len(C))[:, :steps]
    x[:, -1] = parts[:, -1, steps - (stretches - 1) * length]
    return x


def _starts(z0: FloatArray, A: FloatArray | Modes, B: FloatArray, u: FloatArray) -> FloatArray:
    """The lifted states (n, stretches, N) at the start of each stretch, for ``z0`` (n, N) and ``u`` (n, stretches,
    length, n_u): z_(s+1) = A^length z_s + Σ_i A^(length-1-i) B u_i (4.11).
    """
    n, stretches, length, n_u = u.shape
    reached = np.empty((length, n_u, len(A)))  # A^(length-1-i) B
    columns = B
    for i in reversed(range(length)):
        reached[i] = columns.T
        columns = A @ columns
    z = np.empty((n, stretches, len(A)))
    z[:, 0] = z0
    z[:, 1:] = (u[:, :-1].reshape(n * (stretches - 1), length * n_u) @ reached.reshape(length * n_u, -1)).reshape(
        n, stretches - 1, len(A)
    )
    onward = A.after(length) if isinstance(A, Modes) else np.linalg.matrix_power(A, length)
    for s in range(1, stretches):
        z[:, s] += (onward @ z[:, s - 1].T).T
    return z


def _response(seen: Seen, A: FloatArray | Modes, B: FloatArray, C: FloatArray, u: FloatArray) -> FloatArray:
    """(4.3) for the lifted states that ``seen`` sees, (n, steps+1, n_x), with ``u`` (n, steps, n_u).

    Time goes in segments; what each input adds costs the square of the steps.
    """
    n, steps, n_u = u.shape
    n_x, N = C.shape
    x = np.empty((n, steps + 1, n_x))
    markov = np.empty((steps, n_x, n_u))  # C A^k B
    rows = C  # C A^k
    for start in range(0, steps + 1, SEGMENT):
        stop = min(start + SEGMENT, steps + 1)
        observed = np.empty((stop - start, n_x, N))
        for k in range(stop - start):
            observed[k] = rows
            rows = rows @ A
        x[:, start:stop] = seen(observed.reshape(-1, N)).reshape(n, stop - start, n_x)
        markov[start : min(stop, steps)] = observed[: steps - start] @ B
    for first in range(0, steps, SEGMENT):  # the inputs of one segment ...
        inputs = u[:, first : first + SEGMENT]
        for later in range(first, steps, SEGMENT):  # ... act on its own samples and on those of every later one
            samples = min(SEGMENT, steps - later)
            acting = _toeplitz(markov, later - first, inputs.shape[1], samples)
            x[:, later + 1 : later + 1 + samples] += (inputs.reshape(n, inputs.shape[1] * n_u) @ acting).reshape(
                n, samples, n_x
            )
    return x


def _toeplitz(markov: FloatArray, delay: int, inputs: int, samples: int) -> FloatArray:
    """What input i of a segment adds to sample j + 1 of one ``delay`` steps later, (inputs · n_u, samples · n_x)."""
    lag = delay + np.arange(samples) - np.arange(inputs)[:, np.newaxis]
    block = np.where((lag >= 0)[..., np.newaxis, np.newaxis], markov[np.maximum(lag, 0)], 0.0)
    return block.transpose(0, 3, 1, 2).reshape(inputs * markov.shape[2], samples * markov.shape[1])


Advance = Callable[[FloatArray, FloatArray], FloatArray]


def rolled(
    lift: Observables, advance: Advance, C: FloatArray, x0: FloatArray, u: FloatArray, progress: Progress = silent
) -> FloatArray:
    """x̂_k = C z_k with z⁺ = ``advance(z, u)``, shapes as in :func:`linear`.

    What acts on z changes with the input here, so z itself is rolled, for ``ROLLED`` trajectories together.
    """
    n, steps, _ = u.shape
    x = np.empty((n, steps + 1, len(C)))
    for start in range(0, n, ROLLED):
        rows = slice(start, start + ROLLED)
        z = lift.lift(x0[rows])
        x[rows, 0] = z @ C.T
        for k in range(steps):
            z = advance(z, u[rows, k])
            x[rows, k + 1] = z @ C.T
            progress(start * steps + (k + 1) * len(z), n * steps)
    return x


def bilinear_step(A: FloatArray, B: FloatArray, N: FloatArray) -> Advance:
    """z⁺ = A z + B u + Σ_i u_i N_i z (4.6), for z (n, N) and u (n, n_u) at once."""
    every = _side_by_side([A, *N])

    def advance(z: FloatArray, u: FloatArray) -> FloatArray:
        return _driven(z @ every, u) + u @ B.T

    return advance


def generator_step(generator: FloatArray, dt: float) -> Advance:
    """z⁺ = exp(dt (K_0 + Σ_i u_i K_i)) z (4.9), for z (n, N), u (n, n_u) at once; ``generator`` (1 + n_u, N, N) in 1/s.

    By Taylor's series for the action on z, until a term no longer counts; a step where all do is not a number.
    """
    every = _side_by_side(list(dt * generator))

    def advance(z: FloatArray, u: FloatArray) -> FloatArray:
        term, total = z, z
        for j in range(1, MOST_TERMS + 1):
            term = _driven(term @ every, u) / j
            total = total + term
            if not np.abs(term).max(initial=0.0) > np.finfo(float).eps * np.abs(total).max(initial=0.0):
                return total
        return np.full_like(z, np.nan)

    return advance


def _side_by_side(blocks: list[FloatArray]) -> FloatArray:
    """The matrices (N, N) so that z times them holds every product with z, one after the other."""
    return np.concatenate(blocks).T


def _driven(products: FloatArray, u: FloatArray) -> FloatArray:
    """The first of the ``products`` (n, (1 + n_u) N), and the others each times its input of ``u`` (n, n_u)."""
    terms = products.reshape(len(u), 1 + u.shape[1], products.shape[1] // (1 + u.shape[1]))
    return np.asarray(terms[:, 0] + np.einsum("ni,nif->nf", u, terms[:, 1:]))
