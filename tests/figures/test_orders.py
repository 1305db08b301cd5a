from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from koopcli.config.settings import ImageFormat, Series
from koopcli.figures.orders import OrderErrors, draw, drawing


def curve(label="random 0, fresh inputs"):
    order = np.arange(1, 6)
    return OrderErrors(label, order, 40.0 / order**2, 30.0 / order**2, 90.0 / order**2)


class Scored:
    """As much of an evaluation as the figure looks at."""

    def __init__(self, mean):
        self.mean = mean

    def figures(self):
        return {"rmse": {"mean": self.mean, "median": self.mean / 2, "max": 3 * self.mean}}


SERIES = [Series("random 0, fresh inputs", order) for order in (2, 1)]
INPUTS = {"0/evaluation": Scored(10.0), "1/evaluation": Scored(40.0)}


def lines(figure):
    return {line.get_label(): line for line in figure.axes[0].lines}


def test_one_curve_shows_mean_median_and_maximum_and_the_paper():
    figure = draw([curve()])
    found = lines(figure)
    assert set(found) == {"mean", "median", "maximum", "paper's best (11.1 %)"}
    assert found["mean"].get_ydata() == pytest.approx(curve().mean)
    assert found["paper's best (11.1 %)"].get_xydata().tolist() == [[6, 11.1], [7, 11.1]]
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert "(%)" in axes.get_ylabel()
    assert "order" in axes.get_xlabel()


def test_several_curves_are_told_apart():
    figure = draw([curve(), curve("even 0, fresh inputs"), curve("random 0, held inputs")])
    found = lines(figure)
    assert {"random 0, fresh inputs", "even 0, fresh inputs", "random 0, held inputs"} < set(found)
    assert len({line.get_color() for line in found.values()}) == 4


@pytest.mark.parametrize("image", ImageFormat.__args__)
def test_the_same_numbers_give_the_same_bytes(image):
    assert drawing(SERIES, INPUTS, image).image == drawing(SERIES, INPUTS, image).image


def test_the_numbers_come_along():
    numbers = drawing(SERIES, INPUTS, "svg").numbers
    assert numbers["random 0, fresh inputs/order"].values.tolist() == [1, 2]
    assert numbers["random 0, fresh inputs/mean"].values.tolist() == [40.0, 10.0]
    assert numbers["random 0, fresh inputs/mean"].units == "%"


def test_a_changed_drawing_has_another_key(monkeypatch, tmp_path):
    """Pictures are not compared, so the code that draws them is part of their recipe."""
    from koopcli import figures

    before = figures.source_digest.__wrapped__()
    for path in Path(figures.__file__).parent.glob("*.py"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(figures, "__file__", str(tmp_path / "__init__.py"))
    assert figures.source_digest.__wrapped__() == before
    (tmp_path / "style.py").write_text("# another style")
    assert figures.source_digest.__wrapped__() != before


def test_nothing_global_is_left_behind():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    drawing(SERIES, INPUTS, "png")
    assert dict(mpl.rcParams) == before
