"""The identified bicycle predicts a car that is one, and is one more row of the comparison."""

from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.selection.bicycle import LATERAL, identify, roles_of
from koopcli.koopman.selection.blocks import pieces_of
from koopcli.koopman.selection.select import select
from koopcli.koopman.selection.windows import Windows, ahead_of
from koopcli.records import Channels, FloatArray
from tests.koopman.selection.logs import log, smooth_inputs

DT = 0.05
FINE = 10


def drive(rows: int = 1600) -> tuple[FloatArray, FloatArray]:
    """States v_x, v_y, yaw_rate of a car with linear tyres, and its inputs: the speed asked for, and steer."""
    wander = smooth_inputs(rows, 2, 11, keep=0.97)
    u = np.column_stack([8.0 + 2.0 * np.tanh(wander[:, 0]), 0.05 * wander[:, 1]])
    x = np.zeros((rows, 3))
    x[0] = [8.0, 0.0, 0.0]
    for k in range(rows - 1):
        v, v_y, r = x[k]
        for _ in range(FINE):
            front = 80.0 * (u[k, 1] - (v_y + 1.2 * r) / v)
            rear = -90.0 * (v_y - 1.4 * r) / v
            change = np.array([u[k, 0] - v + v_y * r, front + rear - v * r, 0.6 * (1.2 * front - 1.4 * rear)])
            v, v_y, r = np.array([v, v_y, r]) + DT / FINE * change
        x[k + 1] = v, v_y, r
    return x, u


@pytest.mark.parametrize("shown", [[0, 1, 2], [0, 2]])
def test_a_car_that_is_a_bicycle_is_identified_with_v_y_or_without(shown: list[int]) -> None:
    x, u = drive()
    names = [("v_x", "v_y", "yaw_rate")[i] for i in shown]
    episodes = log(x[:, shown], u, states=tuple(names), inputs=("v_command", "steer"))
    roles = roles_of(episodes.state_channels, episodes.input_channels)
    assert roles is not None
    windows = Windows.of(DT, 0.2)
    pieces = pieces_of(episodes)
    bicycle = identify(x[:, shown], u, pieces, windows, roles)
    assert len(bicycle.parameters) == len(LATERAL) + 3 == 11
    starts = windows.starts(pieces, 0.6)
    error = bicycle.predict(x[:, shown], u, starts, 20) - ahead_of(x[:, shown], starts, 20)
    moved = x[starts][:, None, shown] - ahead_of(x[:, shown], starts, 20)
    assert (np.sqrt((error**2).mean(axis=(0, 1))) < 0.1 * np.sqrt((moved**2).mean(axis=(0, 1)))).all()


def test_the_bicycle_is_one_more_row() -> None:
    x, u = drive()
    episodes = log(x, u, states=("v_x", "v_y", "yaw_rate"), inputs=("v_command", "steer"))
    selection = select(episodes, bicycle=True)
    assert selection.models == ("hold", "mean", "dmdc", "chosen", "bicycle")
    assert selection.ratio("bicycle", "hold") < 0.2
    assert "times those of a bicycle identified from the same rows" in selection.verdict


def test_states_that_a_bicycle_does_not_know_are_held() -> None:
    x, u = drive(600)
    episodes = log(
        np.column_stack([x, np.cumsum(u[:, 1])]),
        u,
        states=("v_x", "v_y", "yaw_rate", "roll"),
        inputs=("v_command", "steer"),
    )
    roles = roles_of(episodes.state_channels, episodes.input_channels)
    assert roles is not None
    values = np.asarray(episodes.x)
    forecast = identify(values, u, pieces_of(episodes), Windows.of(DT, 0.2), roles).predict(
        values, u, np.array([50, 90]), 5
    )
    np.testing.assert_array_equal(forecast[:, :, 3], values[[50, 90], 3][:, None].repeat(5, axis=1))


def test_without_steer_or_speed_there_is_no_bicycle() -> None:
    steer = Channels(("steer",), ("rad",))
    assert roles_of(Channels(("v_x", "slip"), ("m/s", "rad")), steer) is None
    assert roles_of(Channels(("v_x", "yaw_rate"), ("m/s", "rad/s")), Channels(("torque",), ("N m",))) is None
    x, u = drive(600)
    assert "bicycle" not in select(log(x, u), bicycle=True).models
