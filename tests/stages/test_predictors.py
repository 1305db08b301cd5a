from __future__ import annotations

import pytest

from koopcli.stages.predictors import describe


@pytest.mark.parametrize(("radius", "shown"), [(1.0, "1"), (0.99999912, "0.999999"), (3.25e54, "3.25e+54")])
def test_a_spectral_radius_has_six_digits_whatever_its_size(radius, shown):
    """One of a fit with a lost basis was printed with 55 digits before its point."""
    about = {"functions": 4, "rank": 4, "directions": 4, "condition": 1.0, "solved_by": "", "spectral_radius": radius}
    assert describe(about).endswith(f"spectral radius {shown}")
