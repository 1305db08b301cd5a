"""The line that says what a figure is of: names from parameters, and what there is several of in few letters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from koopcli.config.pictures import Subject
from koopcli.config.shipped import called, fingerprint, vehicle_named
from koopcli.figures.kit import style
from koopcli.figures.kit.signature import LONGEST, signature
from koopcli.vehicles.plants import PLANTS
from koopcli.vehicles.plants.slips import Slips

CTU = vehicle_named("ctu-2020")


@pytest.mark.parametrize(
    ("plant", "name"), [("slips", "ctu-2020"), ("wheels", "ctu-2020"), ("forces", "ctu-2020 or rimac-2018")]
)
def test_a_vehicle_is_called_after_every_shipped_one_that_has_its_parameters(plant, name):
    """Two shipped vehicles differ in their tyres alone, which the plant of forces knows nothing of."""
    assert called(fingerprint(CTU, PLANTS[plant].uses())) == name


def test_any_other_vehicle_is_told_by_its_parameters():
    one, other = (called(fingerprint(replace(CTU, Jzz=Jzz), Slips.uses())) for Jzz in (1400.5, 1400.6))
    assert one.startswith("own vehicle ")
    assert one != other
    assert called(fingerprint(replace(CTU, r_w=0.4), Slips.uses())) == "ctu-2020"  # which that plant has no use for


def subject(vehicles=(), predictors=()):
    return Subject(tuple(fingerprint(vehicle_named(name), Slips.uses()) for name in vehicles), tuple(predictors))


@pytest.mark.parametrize(
    ("of", "line"),
    [
        (subject(), "koop 1.2"),
        (subject(["bmw-320i"]), "bmw-320i · koop 1.2"),
        (subject(["bmw-320i"], ["EDMD, order 7"]), "bmw-320i · EDMD, order 7 · koop 1.2"),
        (subject(["bmw-320i"], [f"EDMD, order {i}" for i in range(7)]), "bmw-320i · 7 predictors: EDMD · koop 1.2"),
        (subject(["bmw-320i", "ctu-2020"]), "2 vehicles: bmw-320i, ctu-2020 · koop 1.2"),
        (
            subject(["bmw-320i", "ctu-2020"], ["eigenfunctions, optimal", "hold the first state"]),
            "2 vehicles · 2 predictors · koop 1.2",
        ),
    ],
)
def test_several_are_counted_and_named_where_there_is_room(of, line):
    assert signature(of, "1.2") == line


def test_a_line_of_the_most_letters_fits_the_column_and_a_longer_one_takes_another():
    text = ("eigenfunctions, polyharmonic " * 3)[:LONGEST]
    wide = TextPath((0, 0), text, prop=FontProperties(family="DejaVu Sans", size=style.SMALLEST)).get_extents().width
    assert wide < 0.98 * 72 * style.COLUMN

    def height(line):
        image = style.render(Figure(figsize=(style.COLUMN, 1.0)), "svg", line).decode()
        return float(image.partition('viewBox="0 0 252 ')[2].partition('"')[0])

    assert height(text + " and more") - height(text) == pytest.approx(72 * style.LINE, abs=1e-3)
    assert np.isclose(height(text), height("short"))
