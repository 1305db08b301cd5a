"""A controller and a plant in a loop: noise, delay, and what each step took."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from koopcli.control.control import TS, Control, Plan
from koopcli.control.driven import FATES, Driven
from koopcli.control.measures import Tracking, cost, settle_time, tracking
from koopcli.control.reference import Reference
from koopcli.errors import InvalidValueError
from koopcli.records import FloatArray

Clock = Callable[[], float]


@dataclass(frozen=True)
class Noise:
    """White noise on what is measured: its deviations of each ``speed`` in m/s and of ``yaw_rate`` in rad/s, a seed."""

    speed: float = 0.0
    yaw_rate: float = 0.0
    seed: int = 0

    @property
    def deviations(self) -> FloatArray:
        """Of v_x, v_y and yaw rate, (3,)."""
        return np.array([self.speed, self.speed, self.yaw_rate])


@dataclass(frozen=True)
class Disturbances:
    """``noise``; ``delay``: samples that inputs come late; ``known``: the plant by which a controller predicts the
    delay away from the inputs on their way, None where it does not.
    """

    noise: Noise | None = None
    delay: int = 0
    known: Driven | None = None

    def __post_init__(self) -> None:
        if self.delay < 0:
            raise InvalidValueError(f"'delay' must be 0 or more samples, got {self.delay}")


CALM = Disturbances()


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a loop of k samples."""

    times: FloatArray
    """(k + 1,) in s."""
    states: FloatArray
    """(k + 1, n_x) of the plant, the body's three first."""
    reference: FloatArray
    """(k + 1, 3)."""
    inputs: FloatArray
    """(k, 4) that acted on the plant: [steer_f, slip_f, steer_r, slip_r] in rad and 1."""
    cpu: FloatArray
    """(k,) seconds that each step of the controller took by the clock; zeros without one."""
    kkt: float
    """The largest KKT residual of the programmes that were accepted."""
    unsolved: int
    """Steps whose programme was not, in which the plan before was kept."""
    settled: float
    """Settle time in s, infinite for a run that did not, or that ended early."""
    cost: float
    """J, infinite for a run that ended early."""
    ended: str | None = None
    """Why it ended early."""
    plans: dict[float, Plan] = field(default_factory=dict)
    """Those of the instants that were asked for, by time in s."""

    @property
    def tracking(self) -> Tracking:
        """How closely the reference was followed, as far as the run went."""
        return tracking(self.states[:, :3], self.reference)


def close(
    controls: Sequence[Control],
    plant: Driven,
    x0: FloatArray,
    seconds: float,
    reference: Reference,
    disturbances: Disturbances = CALM,
    clock: Clock | None = None,
    plans_at: Sequence[float] = (),
) -> list[Run]:
    """Run every one of ``controls`` on a car of its own from ``x0`` (n, 3) for ``seconds``, from zero inputs.

    The cars are integrated together and know nothing of each other. ``reference`` is previewed: a controller is given
    it at its own times. ``clock``: seconds of CPU, such as ``time.process_time``; each step of a controller is timed
    alone. ``plans_at``: times in s whose plans are kept. A car that diverges ends its run, which says why. The same
    arguments give the same runs.
    Raises ``InvalidValueError`` for an ``x0`` of other shape or not finite, and a length below one sample.
    """
    start = np.asarray(x0, dtype=float)
    steps = int(np.rint(seconds / TS)) if np.isfinite(seconds) else 0
    if start.shape != (len(controls), 3) or not np.isfinite(start).all():
        raise InvalidValueError(
            f"a loop starts from finite v_x, v_y, yaw_rate of each of {len(controls)} cars, got the shape {start.shape}"
        )
    if steps < 1:
        raise InvalidValueError(f"a loop runs for one sample of {TS:g} s at least, got {seconds} s")
    asked = {int(np.rint(t / TS)) for t in plans_at}
    state = plant.start(start)
    cars = [_Car(control, row, disturbances, i) for i, (control, row) in enumerate(zip(controls, state, strict=True))]
    going = list(cars)
    for k in range(steps):
        if not going:
            break
        for car in going:
            car.decide(k, reference, clock, k in asked)
        before, acting = (np.array([getattr(car, name) for car in going]) for name in ("before", "acting"))
        after, fates = plant.advance(np.array([car.states[-1] for car in going]), before, acting)
        for car, row, fate in zip(going, after, fates, strict=True):
            car.arrive(row, FATES[int(fate)])
        going = [car for car in going if car.ended is None]
    return [car.run(reference) for car in cars]


class _Car:
    """A controller in its loop."""

    def __init__(self, control: Control, state: FloatArray, disturbances: Disturbances, number: int) -> None:
        control.reset()
        self._control, self._noise, self._known = control, disturbances.noise, disturbances.known
        self._generator = np.random.default_rng([self._noise.seed if self._noise else 0, number])
        self._queue = deque(np.zeros(4) for _ in range(disturbances.delay))
        self.states, self.inputs = [state], list[FloatArray]()
        self.before, self.acting = np.zeros(4), np.zeros(4)
        self._cpu, self._plans = list[float](), dict[float, Plan]()
        self._kkt, self._unsolved = 0.0, 0
        self.ended: str | None = None

    def decide(self, k: int, reference: Reference, clock: Clock | None, keep: bool) -> None:
        """Let the controller ask for inputs, and those act whose time has come."""
        measured = self.states[-1][:3]
        if self._noise:
            measured = measured + self._noise.deviations * self._generator.standard_normal(3)
        if self._known is not None:
            measured = self._predicted(self._known, measured)
        wanted = reference(np.asarray(k * TS + self._control.times))
        begin = clock() if clock else 0.0
        command = self._control.step(measured, wanted)
        self._cpu.append(clock() - begin if clock else 0.0)
        facts = self._control.facts
        self._unsolved += not facts.solved
        self._kkt = max(self._kkt, facts.kkt) if facts.solved else self._kkt
        if keep and (plan := self._control.plan) is not None:
            self._plans[round(k * TS, 9)] = plan
        self._queue.append(command)
        self.before, self.acting = self.acting, self._queue.popleft()

    def arrive(self, state: FloatArray, fate: str | None) -> None:
        """Take the ``state`` a sample later, or end with the ``fate`` of the plant."""
        if fate is None:
            self.states.append(state)
            self.inputs.append(self.acting)
        else:
            self.ended = f"after {TS * len(self.inputs):.2f} s the plant {fate}"

    def run(self, reference: Reference) -> Run:
        """What came of it."""
        times = np.asarray(TS * np.arange(len(self.states)), dtype=float)
        states, follows = np.array(self.states), reference(times)
        body, whole = states[:, :3], self.ended is None
        return Run(
            times=times,
            states=states,
            reference=follows,
            inputs=np.array(self.inputs).reshape(-1, 4),
            cpu=np.array(self._cpu[: len(self.inputs)]),
            kkt=self._kkt,
            unsolved=self._unsolved,
            settled=settle_time(body, follows) if whole else np.inf,
            cost=cost(body, follows) if whole else np.inf,
            ended=self.ended,
            plans=self._plans,
        )

    def _predicted(self, known: Driven, measured: FloatArray) -> FloatArray:
        """Where the inputs on their way take the car until the next one acts, (3,); ``measured`` where that is lost."""
        state, acting = known.start(measured[np.newaxis]), self.acting
        for u in self._queue:
            state, fate = known.advance(state, acting[np.newaxis], u[np.newaxis])
            if fate.any():
                return measured
            acting = u
        return np.asarray(state[0, :3])
