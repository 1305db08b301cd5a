from __future__ import annotations

import pytest

from koopcli.simulation.samples.box import BoxSample
from koopcli.simulation.samples.point import PointSample


@pytest.mark.parametrize("kind", [BoxSample, PointSample])
def test_inputs_drive_a_sample_where_they_are_drawn_and_not_zero(kind):
    assert kind().driven
    assert kind(excitation="held", amplitude=0.1).driven
    assert not kind(excitation="none", amplitude=5.0).driven
    assert not kind(excitation="fresh", amplitude=0.0).driven
