"""What a vehicle's parameters say before anything is simulated: derived numbers, and what looks odd about them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from koopcli.errors import InvalidValueError
from koopcli.simulation.integrate import substeps
from koopcli.vehicles import handling
from koopcli.vehicles.parameters import VehicleParameters
from koopcli.vehicles.plants import PLANTS
from koopcli.vehicles.plants.wheels import TorqueInput

SPEEDS = (1.0, 5.0, 30.0)  # m/s
USUAL: dict[str, tuple[float, float, str]] = {
    "m": (300.0, 4e4, "kg"),
    "wheelbase": (1.5, 8.0, "m"),
    "r_w": (0.15, 0.7, "m"),
    "J_R": (0.2, 30.0, "kg m^2"),
    "Jzz over m l_f l_r": (0.5, 2.0, "1"),
    "peak grip": (0.2, 1.6, "1"),
}  # what road vehicles have; beyond it a unit may be wrong


@dataclass(frozen=True)
class Derived:
    """A number that follows from the parameters."""

    name: str
    value: float
    unit: str


def plants_of(p: VehicleParameters) -> list[str]:
    """The plants that the vehicle has all parameters for."""
    plants = []
    for name, plant in PLANTS.items():
        try:
            plant().of(p)
        except InvalidValueError:
            continue
        plants.append(name)
    return plants


def derived(p: VehicleParameters, dt: float) -> list[Derived]:
    """Loads, stiffnesses, steady cornering and wheel poles with the integration steps for samples of ``dt`` s."""
    front, rear = handling.wheel_loads(p)
    numbers = [
        Derived("wheelbase", p.l_f + p.l_r, "m"),
        Derived("load of a front wheel", front, "N"),
        Derived("load of a rear wheel", rear, "N"),
    ]
    if p.lateral is None or p.longitudinal is None:
        return numbers
    stiffness = handling.cornering_stiffness(p)
    gradient, critical = handling.understeer_gradient(p), handling.critical_speed(p)
    numbers += [
        Derived("cornering stiffness of the front axle", stiffness[0], "N/rad"),
        Derived("cornering stiffness of the rear axle", stiffness[1], "N/rad"),
        Derived("understeer gradient", gradient, "rad s^2/m"),
        Derived("critical speed", critical, "m/s"),
    ]
    if p.r_w is None or p.J_R is None:
        return numbers
    for speed in SPEEDS:
        pole = max(handling.wheel_poles(p, speed, TorqueInput.v_eps))
        numbers.append(Derived(f"wheel pole at {speed:g} m/s", pole, "1/s"))
        numbers.append(Derived(f"substeps at {speed:g} m/s", _substeps(p, speed, dt), "1"))
    return numbers


def _substeps(p: VehicleParameters, speed: float, dt: float) -> float:
    """Integration steps of one sample of a car that rolls straight ahead."""
    assert p.r_w is not None, "checked by the caller"
    plant, rate = TorqueInput(p), speed / p.r_w
    x, u = np.array([[speed, 0.0, 0.0, rate, rate]]), np.zeros((1, len(TorqueInput.inputs)))
    return float(substeps(plant.fastest_rate(x, u, dt), dt)[0])


def measures(p: VehicleParameters) -> dict[str, float | None]:
    """What road vehicles have in common, as far as it is known of this one: by name, as in ``USUAL``."""
    return {
        "m": p.m,
        "wheelbase": p.l_f + p.l_r,
        "r_w": p.r_w,
        "J_R": p.J_R,
        "Jzz over m l_f l_r": p.Jzz / (p.m * p.l_f * p.l_r),
        "peak grip": None if p.lateral is None else p.mu_scale * p.lateral.mu,
    }


def odd(values: Mapping[str, float | None]) -> Iterator[str]:
    """Which of the measures ``values`` no road vehicle has, in words."""
    for name, value in values.items():
        low, high, unit = USUAL[name]
        if value is not None and not low <= value <= high:
            shown = "" if unit == "1" else f" {unit}"
            doubt = "" if name == "peak grip" else ": is its unit right?"  # which has none
            yield f"{name} is {value:.4g}{shown}; road vehicles have {low:g} to {high:g}{doubt}"


def remarks(p: VehicleParameters) -> Iterator[str]:
    """What is allowed but unusual, in words."""
    yield from odd(measures(p))
    if p.lateral is None or p.longitudinal is None:
        yield "no tyres: the tables [lateral] and [longitudinal] are for the plants 'slips' and 'wheels'"
    elif math.isfinite(critical := handling.critical_speed(p)):
        yield f"the car oversteers: straight running is unstable beyond {critical:.4g} m/s"
    if p.r_w is None or p.J_R is None:
        yield "no wheels: J_R and r_w are for the plant 'wheels'"
