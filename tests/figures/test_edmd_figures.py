"""The figures of EDMD: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.config.pictures import Plot
from koopcli.errors import InvalidValueError
from koopcli.figures import orders, random_input, spectrum
from koopcli.figures.kit.figure import Source
from koopcli.figures.orders import OrderErrors
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.predictor.dynamics.diagonal import Diagonal
from koopcli.koopman.scores.restarts import restarted
from koopcli.records import Trajectories
from tests.stages.toys import _looked_up, _predictor, _trajectories, figure_records, figure_settings


def curve(label="random 0, fresh inputs"):
    order = np.arange(1, 6)
    return OrderErrors(label, order, 40.0 / order**2, 30.0 / order**2, 90.0 / order**2)


class Scored:
    """As much of an evaluation as the figure looks at."""

    def __init__(self, mean):
        self.mean = mean

    def figures(self):
        return {"rmse": {"mean": self.mean, "median": self.mean / 2, "max": 3 * self.mean}}


def lines(figure):
    return {line.get_label(): line for line in figure.axes[0].lines}


def _with(A):
    """The toy predictor with another A."""
    predictor = _predictor()
    return replace(predictor, dynamics=replace(predictor.dynamics, A=A))


def test_one_curve_shows_mean_median_and_maximum_and_the_paper():
    figure = orders.draw([curve()])
    found = lines(figure)
    assert set(found) == {"mean", "median", "maximum", "paper's best (11.1 %)"}
    assert found["mean"].get_ydata() == pytest.approx(curve().mean)
    assert found["paper's best (11.1 %)"].get_xydata().tolist() == [[6, 11.1], [7, 11.1]]
    assert figure.axes[0].get_yscale() == "log"


def test_several_curves_are_told_apart():
    figure = orders.draw([curve(), curve("even 0, fresh inputs"), curve("random 0, held inputs")])
    found = lines(figure)
    assert {"random 0, fresh inputs", "even 0, fresh inputs", "random 0, held inputs"} < set(found)
    assert len({line.get_color() for line in found.values()}) == 4


def test_a_curve_goes_by_rising_order():
    sources = [Source("a", 2, {"evaluation": Scored(10.0)}), Source("a", 1, {"evaluation": Scored(40.0)})]
    numbers = orders.numbers(orders.select(sources, figure_settings("orders")))
    assert numbers["a/order"].values.tolist() == [1, 2]
    assert numbers["a/mean"].values.tolist() == [40.0, 10.0]
    assert numbers["a/mean"].units == "%"


def sources(name):
    return [Source("", None, {role.partition("/")[2]: record for role, record in figure_records(name).items()})]


def test_predictions_start_afresh_from_the_true_state():
    data, predictor = _trajectories(7), _predictor()
    starts, segments = restarted(predictor, data.x, data.u, 3)
    assert starts == [0, 3, 6]
    assert [segment.shape[1] for segment in segments] == [4, 4, 2]
    for k, segment in zip(starts, segments, strict=True):
        whole = predictor.predict(data.x[:, k], data.u[:, k:])
        assert segment == pytest.approx(whole[:, : segment.shape[1]])
    one_piece = restarted(predictor, data.x, data.u, 100)
    assert one_piece[0] == [0]
    assert one_piece[1][0] == pytest.approx(predictor.predict(data.x[:, 0], data.u))


def test_every_restart_is_visible():
    shown = random_input.select(sources("random-input"), figure_settings("random-input"))
    figure = random_input.draw(shown)
    assert len(figure.axes) == 3
    for i, axes in enumerate(figure.axes):
        marks = [line for line in axes.lines if len(line.get_xdata()) == 2 and len(set(line.get_xdata())) == 1]
        assert [line.get_xdata()[0] for line in marks] == pytest.approx([0.03, 0.06])
        dots = [line for line in axes.lines if line.get_marker() == "o"]
        assert [dot.get_ydata()[0] for dot in dots] == [segment[0, i] for segment in shown.predicted]
        true = next(line for line in axes.lines if line.get_label() == "true")
        assert true.get_ydata().tolist() == shown.true[:, i].tolist()
    numbers = random_input.numbers(shown)
    assert numbers["segment"].values.tolist() == [0] * 4 + [1] * 4 + [2] * 2
    assert numbers["segment time"].values[[3, 4]] == pytest.approx(
        [0.03, 0.03]
    )  # the end of one, the start of the next
    error = np.linalg.norm(shown.predicted[1][1:] - shown.true[4:7]) / np.linalg.norm(shown.true[4:7])
    assert numbers["segment rmse"].values[1] == pytest.approx(100 * error)


def test_a_prediction_that_explodes_is_refused():
    records = {"predictor": _predictor(growth=1e200), "trajectories": _trajectories(7)}
    with np.errstate(all="ignore"), pytest.raises(InvalidValueError, match=r"plot\.restart"):
        random_input.select([Source("", None, records)], figure_settings("random-input"))


def test_eigenvalues_of_a_matrix_and_their_rates():
    shown = spectrum.select([Source("", None, {"predictor": _predictor()})], figure_settings("spectrum"))
    assert shown.copies == 1
    assert np.sort_complex(shown.eigenvalues) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(_predictor().dynamics.A))
    )
    assert np.exp(shown.rates * 0.01) == pytest.approx(shown.eigenvalues)
    plane, density = spectrum.draw(shown).axes
    (rings,) = [line for line in plane.lines if line.get_marker() == "o"]
    upper = shown.rates[shown.rates.imag >= 0]  # of a pair the half that is drawn
    assert sorted(rings.get_xdata()) == pytest.approx(sorted(upper.imag / (2 * np.pi)))
    assert sorted(rings.get_ydata()) == pytest.approx(sorted(-upper.real))
    assert rings.get_label() == "8 that decay or stay"
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("frequency (Hz)", "damping (1/s)")
    assert density.get_shared_y_axes().joined(plane, density)


def test_rings_that_lie_on_one_another_are_counted():
    """The bars hold every eigenvalue, each as often as it is there, in bins that are even on the axis of damping."""
    rates = np.concatenate([np.full(500, -0.03), [-20.0, 0.0, 0.5]])
    predictor = _with(np.diag(np.exp(0.01 * rates)))
    shown = spectrum.select([Source("", None, {"predictor": predictor})], figure_settings("spectrum"))
    numbers = {name: array.values for name, array in spectrum.numbers(shown).items()}
    assert numbers["bin/count"].sum() == 503
    low, high = numbers["bin/damping from"], numbers["bin/damping to"]
    for damping, count in zip((0.03, 20.0, 0.0, -0.5), (500, 1, 1, 1), strict=True):
        assert numbers["bin/count"][(low <= damping + 1e-9) & (damping - 1e-9 < high)].sum() >= count
    (bars,) = spectrum.draw(shown).axes[1].patches
    assert bars.get_data().values.tolist() == numbers["bin/count"].tolist()
    many = _looked_up()
    twice = spectrum.select([Source("", None, {"predictor": many})], figure_settings("spectrum"))
    assert twice.counts.sum() == 2 * len(many.dynamics.modes.rates)


def test_eigenvalues_of_modes_are_those_of_one_block():
    predictor = _looked_up()
    assert isinstance(predictor.dynamics, Diagonal)
    shown = spectrum.select([Source("", None, {"predictor": predictor})], figure_settings("spectrum"))
    assert (shown.copies, len(shown.rates)) == (2, 3)
    assert np.sort_complex(shown.eigenvalues) == pytest.approx(
        np.sort_complex(np.linalg.eigvals(predictor.dynamics.modes.block))
    )
    assert set(spectrum.numbers(shown)["copies"].values) == {2.0}


def test_growing_eigenvalues_are_told_apart_and_a_zero_has_no_rate():
    predictor = _with(np.diag([1.5, 0.5, 0.0, 0.5, 0.5, 0.5, 0.5, 1.0]))
    shown = spectrum.select([Source("", None, {"predictor": predictor})], figure_settings("spectrum"))
    assert np.sort(shown.rates.real)[0] == -np.inf
    plane, _density = spectrum.draw(shown).axes
    (growing,) = [line for line in plane.lines if line.get_marker() == "^"]
    assert growing.get_ydata() == pytest.approx([-np.log(1.5) / 0.01])
    assert sum(len(line.get_xdata()) for line in plane.lines if line.get_marker() in ("o", "^")) == 7
    assert shown.counts.sum() == 7


def test_random_input_takes_any_predictor(plant):
    """It asks for states and inputs, not for the method."""
    data = _trajectories(7)
    dmd = edmd.fit(data, edmd.FitEdmd.of(basis="states").basis_from(data))
    shown = random_input.select(
        [Source("", None, {"predictor": dmd, "trajectories": data})], Plot("random-input", "png", "", restart=2)
    )
    assert len(shown.predicted) == 4
    assert isinstance(data, Trajectories)


def grid_of(names, values, places, mean):
    from koopcli.koopman.scores.swept import SCORES, Swept

    mean = np.asarray(mean, dtype=float)
    return Swept(tuple(names), tuple(map(tuple, values)), np.array(places), dict.fromkeys([*SCORES, "functions"], mean))


def sweep_of(table):
    from koopcli.figures import sweep
    from koopcli.figures.kit.figure import Source

    shown = sweep.select([Source("", None, {"sweep": table})], None)
    assert sweep.numbers(shown)
    return shown, sweep.draw(shown)


def test_a_sweep_goes_along_its_longest_row_of_numbers_and_seeds_are_a_band():
    places = [(i, j, k) for i in range(2) for j in range(3) for k in range(2)]
    table = grid_of(
        ["fit-edmd.terms", "fit-edmd.order", "sample.seed"],
        [("linear", "bilinear"), ("1", "2", "3"), ("0", "1")],
        places,
        [10 * i + j + 0.5 * k for i, j, k in places],
    )
    shown, _ = sweep_of(table)
    assert shown.name == "fit-edmd.order"
    assert [curve.label for curve in shown.curves] == ["terms linear", "terms bilinear"]
    assert shown.curves[1].middle.tolist() == [10.25, 11.25, 12.25]
    assert shown.curves[1].low.tolist() == [10, 11, 12]
    assert shown.seeds == 2


@pytest.mark.parametrize(
    ("names", "values", "places"),
    [
        (["a.count", "b.count"], [("3", "4"), ("3", "4")], [(0, -1), (1, -1), (-1, 0), (-1, 1)]),  # one last name
        (["fit-edmd.ridge"], [("0", "1e-6", "1e-2", "1")], [(0,), (1,), (2,), (3,)]),  # from nothing to far
        (["sample.seed"], [("0", "1", "2")], [(0,), (1,), (2,)]),  # seeds alone
        (["fit-edmd.basis"], [("tensor", "total")], [(0,), (1,)]),  # words alone
        (["fit-edmd.order", "fit-edmd.ridge"], [("1", "2"), tuple(map(str, range(20)))],
         [(i, j) for i in range(2) for j in range(20)]),
    ],
)  # fmt: skip
def test_odd_sweeps_are_drawn(names, values, places):
    shown, figure = sweep_of(grid_of(names, values, places, np.arange(1.0, len(places) + 1)))
    assert len(shown.curves) <= 12
    figure.draw_without_rendering()
