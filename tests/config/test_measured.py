"""Every number that advice names is measured again, at full size, by the command that stands beside it."""

from __future__ import annotations

import json
import shlex

import pytest

from koopcli.config.measured import GAINS

CLOSE = 0.02  # processors move the last bits of a fit, and a cut of 1e-14 hands them on


@pytest.mark.slow  # a minute for each
@pytest.mark.parametrize("name", GAINS)
def test_a_gain_is_as_large_as_it_is_said_to_be(koop, name):
    gain = GAINS[name]
    for command, said in ((gain.command_before, gain.before), (gain.command_after, gain.after)):
        found = json.loads(koop(*shlex.split(command)[1:], "--json", tiny=False).out)
        assert found["rmse"]["mean"] == pytest.approx(said, rel=CLOSE)
        assert found["diverged"] == 0
