"""What came of a scenario: the runs of all its cars, as a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from koopcli.content import Content
from koopcli.control.loop import Run
from koopcli.control.measures import tracking
from koopcli.koopman.scores.metrics import summary
from koopcli.records import Array, Channels, FloatArray, IntArray, Meta, Packed

BODY = Channels(("v_x", "v_y", "yaw_rate"), ("m/s", "m/s", "rad/s"))
INPUTS = Channels(("steer_f", "slip_ratio_f", "steer_r", "slip_ratio_r"), ("rad", "1", "rad", "1"))


@dataclass(frozen=True, eq=False, repr=False)
class ClosedLoop(Content):
    """n closed loops of k samples of ``dt`` s.

    ``states`` (n, k + 1, 3) of the bodies, not a number after an early end; ``reference`` (k + 1, 3); ``inputs``
    (n, k, 4) that acted; ``cpu`` (n, k): seconds of CPU that each step of the controller took; ``settled`` and ``cost``
    (n,): settle time in s and J, infinite where there is none; ``kkt`` (n,): the largest residual of what was
    accepted; ``unsolved`` (n,): steps whose programme was not solved; ``ended`` (n,): why each ended early, empty for
    none. ``solves``: whether the controller solves a programme at all; ``tracks``: whether a reference that moves was
    followed.
    """

    states: FloatArray
    reference: FloatArray
    inputs: FloatArray
    cpu: FloatArray
    settled: FloatArray
    cost: FloatArray
    kkt: FloatArray
    unsolved: IntArray
    ended: tuple[str, ...]
    dt: float
    solves: bool
    tracks: bool

    @classmethod
    def of(
        cls, runs: Sequence[Run], steps: int, reference: FloatArray, *, dt: float, solves: bool, tracks: bool
    ) -> ClosedLoop:
        """The record of ``runs`` that were to last so many ``steps``."""
        n = len(runs)
        states, inputs = np.full((n, steps + 1, 3), np.nan), np.full((n, steps, 4), np.nan)
        cpu = np.full((n, steps), np.nan)
        for i, run in enumerate(runs):
            states[i, : len(run.states)] = run.states[:, :3]
            inputs[i, : len(run.inputs)], cpu[i, : len(run.cpu)] = run.inputs, run.cpu
        return cls(
            states=states,
            reference=reference,
            inputs=inputs,
            cpu=cpu,
            settled=np.array([run.settled for run in runs]),
            cost=np.array([run.cost for run in runs]),
            kkt=np.array([run.kkt for run in runs]),
            unsolved=np.array([run.unsolved for run in runs], dtype=np.int64),
            ended=tuple(run.ended or "" for run in runs),
            dt=dt,
            solves=solves,
            tracks=tracks,
        )

    def __repr__(self) -> str:
        return f"ClosedLoop: {len(self.states)} × {self.inputs.shape[1]} steps of {self.dt:g} s, states {BODY}"

    def figures(self) -> Meta:
        """The numbers that scripts read (`--json`)."""
        steps = 1e3 * self.cpu[np.isfinite(self.cpu)]
        rms = None
        if self.tracks and not self.ended[0]:
            errors = tracking(self.states[0], self.reference)
            speed = float(np.sqrt(((self.states[0] - self.reference)[:, 0] ** 2).mean()))
            rms = {"v_x": speed, "v_y": errors.v_y, "yaw_rate": errors.yaw_rate, "offset": errors.offset}
        return {
            "cars": len(self.states),
            "seconds": self.inputs.shape[1] * self.dt,
            "settled": [value if np.isfinite(value) else None for value in self.settled.tolist()],
            "J": [value if np.isfinite(value) else None for value in self.cost.tolist()],
            "settled_share": float(np.isfinite(self.settled).mean()),
            "kkt_worst": float(self.kkt.max()) if self.solves else None,
            "unsolved": int(self.unsolved.sum()),
            "step_ms": {"median": float(np.median(steps)), "p99": float(np.quantile(steps, 0.99))},
            "rms": rms,
            "cost": summary(self.cost[np.isfinite(self.cost)]),
            "ended": [text for text in self.ended if text],
        }

    def table(self) -> tuple[list[str], list[list[Any]]]:
        """Time, states, reference and inputs of every car."""
        names = [f"{name} ({unit})" for name, unit in zip(BODY.names, BODY.units, strict=True)]
        inputs = [f"{name} ({unit})" for name, unit in zip(INPUTS.names, INPUTS.units, strict=True)]
        header = ["car", "time (s)", *names, *(f"reference {name}" for name in names), *inputs]
        rows = []
        for i, states in enumerate(self.states):
            acting = np.vstack([self.inputs[i], np.full((1, 4), np.nan)])
            for k, row in enumerate(np.hstack([states, self.reference, acting]).tolist()):
                rows.append([i, round(k * self.dt, 9), *("" if np.isnan(value) else value for value in row)])
        return header, rows

    def pack(self) -> Packed:
        """The loops for storage."""
        arrays = {
            "states": Array(self.states, ("car", "sample", "state"), BODY.unit_text),
            "reference": Array(self.reference, ("sample", "state"), BODY.unit_text),
            "inputs": Array(self.inputs, ("car", "step", "input"), INPUTS.unit_text),
            "cpu": Array(self.cpu, ("car", "step"), "s"),
            "settled": Array(self.settled, ("car",), "s"),
            "cost": Array(self.cost, ("car",), "1"),
            "kkt": Array(self.kkt, ("car",), "1"),
            "unsolved": Array(self.unsolved, ("car",), "1"),
        }
        facts = {"dt": self.dt, "solves": self.solves, "tracks": self.tracks, "ended": list(self.ended)}
        return Packed(arrays, facts)

    @classmethod
    def unpack(cls, packed: Packed) -> ClosedLoop:
        """The inverse of :meth:`pack`."""
        meta = {**packed.meta, "ended": tuple(packed.meta["ended"])}
        return cls(**meta, **{name: array.values[...] for name, array in packed.arrays.items()})
