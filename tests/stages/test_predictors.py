from __future__ import annotations

import pytest

from koopcli.stages.predictors import size


@pytest.mark.parametrize(("radius", "shown"), [(1.0, "1"), (0.99999912, "0.999999"), (3.25e54, "3.25e+54")])
def test_a_spectral_radius_has_six_digits_whatever_its_size(radius, shown):
    """One of a fit with a lost basis was printed with 55 digits before its point."""
    assert size({"functions": 4, "spectral_radius": radius}) == f"4 functions, spectral radius {shown}"
