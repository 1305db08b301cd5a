"""Measured data of known systems: episodes with violent seams between them."""

from __future__ import annotations

import numpy as np

from koopcli.records import Channels, Episodes


def channels(prefix: str, n: int, unit: str = "1") -> Channels:
    return Channels(tuple(f"{prefix}{i}" for i in range(n)), (unit,) * n)


class Delayed:
    """x⁺ = c + Σ_j F_j x_{k-j} + Σ_j G_j u_{k-j} + Σ_i u_i H_i x, with ``delays`` past states and inputs."""

    def __init__(self, delays: int = 2, n_x: int = 2, n_u: int = 2, products: float = 0.2) -> None:
        rng = np.random.default_rng(3)
        self.c = rng.uniform(-1, 1, n_x)
        self.F = rng.uniform(-1, 1, (delays + 1, n_x, n_x)) * 0.5 / (n_x * (delays + 1))
        self.F[0] += 0.4 * np.eye(n_x)
        self.G = rng.uniform(-1, 1, (delays + 1, n_x, n_u))
        self.H = products * rng.uniform(-1, 1, (n_u, n_x, n_x))
        self.delays, self.n_x, self.n_u = delays, n_x, n_u

    def next(self, xs: list[np.ndarray], us: list[np.ndarray]) -> np.ndarray:
        """From all states and inputs (n, ...) so far, the oldest first."""
        x = self.c + sum(xs[-1 - j] @ F.T for j, F in enumerate(self.F))
        x = x + sum(us[-1 - j] @ G.T for j, G in enumerate(self.G))
        return x + np.einsum("ni,ifs,ns->nf", us[-1], self.H, xs[-1])

    def episodes(self, lengths=(60, 9, 140, 40, 4), seed: int = 0, dt: float = 0.1, offset: float = 1e3) -> Episodes:
        """Episodes whose first states are far from one another, and whose last input is far from all others."""
        rng = np.random.default_rng(seed)
        x, u = [], []
        for e, length in enumerate(lengths):
            us = list(rng.uniform(-1, 1, (length, 1, self.n_u)))
            far = offset if self.delays >= length else 0.0
            xs = list(rng.uniform(-1, 1, (min(self.delays + 1, length), 1, self.n_x)) * (5 + e) + far)
            while len(xs) < length:
                xs.append(self.next(xs, us[: len(xs)]))
            us[-1] = us[-1] + offset  # acts beyond the episode: no pair may use it
            x.append(np.concatenate(xs))
            u.append(np.concatenate(us))
        return episodes_of(x, u, dt)


def episodes_of(x: list[np.ndarray], u: list[np.ndarray], dt: float = 0.1) -> Episodes:
    bounds = np.concatenate([[0], np.cumsum([len(part) for part in x])])
    states, inputs = np.concatenate(x), np.concatenate(u)
    return Episodes(
        states, inputs, dt, bounds, np.arange(len(x)) * 100.0, np.zeros(len(x), dtype=np.int64),
        channels("x", states.shape[1], "m/s"), channels("u", inputs.shape[1], "rad"),
    )  # fmt: skip
