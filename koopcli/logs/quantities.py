"""What logs of cars hold, by name: what else it is called, in which units it is logged, and how large it can be."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
SUFFIXES = {  # endings of names, the longest first, and the units that they say
    "rad_per_s": "rad/s",
    "deg_per_s": "deg/s",
    "m_per_s": "m/s",
    "rad_s": "rad/s",
    "deg_s": "deg/s",
    "radps": "rad/s",
    "degps": "deg/s",
    "mpss": "m/s²",
    "mps2": "m/s²",
    "kmph": "km/h",
    "ms2": "m/s²",
    "dps": "deg/s",
    "mps": "m/s",
    "kmh": "km/h",
    "kph": "km/h",
    "mph": "mph",
    "deg": "deg",
    "rad": "rad",
    "rpm": "rpm",
    "pct": "%",
    "kpa": "kPa",
    "bar": "bar",
    "nm": "N m",
}


@dataclass(frozen=True)
class Quantity:
    """A signal: its name in maps, its SI unit, what it is called elsewhere, and words that no such name holds.

    ``kind``: where a first map puts it; None for what it does not use. Synonyms are words joined by ``_``.
    """

    name: str
    unit: str
    kind: Literal["state", "input"] | None
    synonyms: tuple[str, ...]
    never: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Limits:
    """Between what a magnitude lies: the median where it is ``usual``, else 99.9 % of it.

    ``other``: the unit that it may be in where it does not, ``factor`` times as large.
    """

    low: float
    high: float
    unit: str
    other: str
    factor: float
    usual: bool = False


def _quantity(name: str, unit: str, kind: Literal["state", "input"] | None, synonyms: str, never: str = "") -> Quantity:
    return Quantity(name, unit, kind, tuple(synonyms.split()), frozenset(never.split()))


COMMANDS = "command cmd target setpoint desired reference ref demand request"
NO_SPEED = f"angular wheel engine motor wind gps rate y z lat lateral side yaw pitch roll {COMMANDS}"
QUANTITIES = (
    _quantity(
        "v_x",
        "m/s",
        "state",
        "v_x vx speed vehicle_speed car_speed longitudinal_velocity longitudinal_speed velocity_x vel_x speed_x v_long "
        "vlong velocity vel v x_dot xdot linear_x linear_velocity_x twist_linear_x vehicle_velocity v_ego vego",
        NO_SPEED,
    ),
    _quantity(
        "v_y",
        "m/s",
        "state",
        "v_y vy lateral_velocity lateral_speed velocity_y vel_y speed_y v_lat vlat side_speed y_dot ydot linear_y "
        "linear_velocity_y",
        f"angular wheel {COMMANDS}",
    ),
    _quantity(
        "side_slip",
        "rad",
        "state",
        "side_slip sideslip side_slip_angle sideslip_angle beta body_slip slip_angle",
        "wheel tire tyre front rear",
    ),
    _quantity(
        "yaw_rate",
        "rad/s",
        "state",
        "yaw_rate yawrate yaw_velocity yaw_vel yawvel yaw_speed wz w_z gyro_z gyroz gz omega_z omegaz rate_z rot_z "
        "angular_velocity_z ang_vel_z angvel_z psi_dot psidot dpsi yaw_dot rotation_rate_z gyr_z angular_z r omega",
        f"wheel engine motor front rear fl fr rl rr x y {COMMANDS}",
    ),
    _quantity(
        "steer",
        "rad",
        "input",
        "steer steer_angle steering_angle steering_wheel_angle steer_wheel_angle road_wheel_angle delta swa steering "
        "str_ang steerangle steeringangle steering_position handwheel_angle handwheel wheel_angle sas_angle delta_f "
        "steer_f servo delta_wheel sw_pos sw_position sw_angle",
        "rate speed torque velocity",
    ),
    _quantity(
        "throttle",
        "1",
        "input",
        "throttle accelerator gas accel_pedal acc_pedal accelerator_pedal throttle_position gas_pedal pedal aps tps",
        "brake",
    ),
    _quantity(
        "brake",
        "1",
        "input",
        "brake brakes brake_pressure brake_pedal brake_torque p_brake pbrake brake_cmd brk",
        "light switch temp temperature",
    ),
    _quantity(
        "torque",
        "N m",
        "input",
        "torque torques motor_torque drive_torque engine_torque wheel_torque trq m_drive axle_torque twheel t_wheel",
        "steering steer brake",
    ),
    _quantity("v_command", "m/s", "input", "v_command speed_command speed_cmd cmd_speed target_speed v_ref v_cmd"),
    _quantity(
        "a_x",
        "m/s²",
        None,
        "a_x ax acc_x accel_x acceleration_x longitudinal_acceleration linear_acceleration_x long_acc long_accel "
        "acc_long longitudinal_acc",
    ),
    _quantity(
        "a_y",
        "m/s²",
        None,
        "a_y ay acc_y accel_y acceleration_y lateral_acceleration linear_acceleration_y lat_acc lat_accel acc_lat "
        "lateral_acc",
    ),
    _quantity("a_z", "m/s²", None, "a_z az acc_z accel_z acceleration_z vertical_acceleration linear_acceleration_z"),
)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
UNITS_OF = {  # what a signal is logged in, and up to which magnitude a column of unknown unit is taken to be in it
    "m/s": (("m/s", 60.0), ("km/h", 400.0)),
    "rad/s": (("rad/s", 4.0), ("deg/s", 1000.0)),
    "rad": (("rad", 1.0), ("deg", 2000.0)),
    "1": (("1", 1.5), ("%", 110.0)),
    "m/s²": (("g", 1.6), ("m/s²", 300.0)),
    "N m": (("N m", 1e6),),
    "Pa": (("bar", 300.0), ("kPa", 30_000.0), ("Pa", 1e9)),
}
LIMITS = {
    "v_x": Limits(0.0, 120.0, "m/s", "km/h", 3.6),
    "v_y": Limits(0.0, 60.0, "m/s", "km/h", 3.6),
    "yaw_rate": Limits(0.0, 12.0, "rad/s", "deg/s", 57.3),
    "steer": Limits(0.0, 13.0, "rad", "deg", 57.3),
    "a_z": Limits(5.0, 15.0, "m/s²", "g", 9.81, usual=True),
}


def words_of(name: str) -> tuple[str, ...]:
    """The words of a column's name, in small letters: ``gyroZ`` is gyro and z."""
    return tuple(word for word in re.split(r"[^a-z0-9]+", CAMEL.sub("_", name).lower()) if word)


def unit_in(name: str) -> tuple[str, str]:
    """The words of a ``name`` without the unit that it ends in, joined by ``_``, and that unit; "" where none."""
    joined = "_".join(words_of(name))
    for suffix, unit in SUFFIXES.items():
        if joined.endswith(f"_{suffix}"):
            return joined.removesuffix(f"_{suffix}"), unit
    return joined, ""


def quantity_of(name: str) -> tuple[Quantity, int] | None:
    """What a column's ``name`` means, and how surely: 0 where it is that alone, else the number of words beside it.

    None for a name that means none of ``QUANTITIES``, or another thing with a word of theirs.
    """
    bare = unit_in(name)[0]
    words = bare.split("_")
    best: tuple[int, int, Quantity] | None = None
    for quantity in QUANTITIES:
        for synonym in quantity.synonyms:
            parts = synonym.split("_")
            exact = bare == synonym or bare.replace("_", "") == synonym.replace("_", "")
            within = len(synonym) > 1 and any(
                words[start : start + len(parts)] == parts for start in range(len(words) - len(parts) + 1)
            )
            if not exact and (not within or quantity.never & set(words)):
                continue
            beside = 0 if exact else len(words) - len(parts)
            if best is None or (-beside, len(synonym)) > best[:2]:
                best = (-beside, len(synonym), quantity)
    return (best[2], -best[0]) if best else None


def unit_by_magnitude(unit: str, largest: float) -> str:
    """The unit in which a signal of the SI ``unit`` is logged, if 99.9 % of its magnitudes are below ``largest``."""
    for name, limit in UNITS_OF.get(unit, ()):
        if largest <= limit:
            return name
    return unit
