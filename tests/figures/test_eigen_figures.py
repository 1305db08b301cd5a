"""The figures of an evaluation, most of them drawn for eigenfunctions: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from koopcli.errors import InvalidValueError
from koopcli.figures import (
    compare,
    density,
    energy_surface,
    error_map,
    error_side,
    horizon,
    mean_trajectory,
    rmse_histogram,
)
from koopcli.figures.kit.ends import apart
from koopcli.figures.kit.figure import Source
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.scores.evaluation import evaluate
from koopcli.records import Sample
from koopcli.simulation import sampling
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, eigen_fit, surface_of, trajectories_of
from tests.stages.toys import figure_settings


@pytest.fixture(scope="module")
def made(vehicle):
    plant = SlipInput(vehicle)
    training, test = trajectories_of(plant, surface_of(plant), 30), trajectories_of(plant, ball_of(plant, 60), 10)
    predictor = eigen_fit(training, boundary="optimal", cut=1e-8, tabulated=20)
    evaluation = evaluate(predictor, test, slice(None), 0)
    return {"training": training, "trajectories": test, "predictor": predictor, "evaluation": evaluation}


def shown_by(module, *records):
    name = module.__name__.rpartition(".")[2].replace("_", "-")
    sources = [Source(f"predictor {i}" if len(records) > 1 else "", None, one) for i, one in enumerate(records)]
    return module.select(sources, figure_settings(name))


def test_a_bin_of_the_slice_has_the_mean_of_its_states(made):
    """Recomputed state by state from the evaluation; the balls are all states, the largest errors last."""
    evaluation = replace(made["evaluation"], **of_many(600))
    shown = shown_by(error_map, {"evaluation": evaluation})
    numbers = {name: array.values for name, array in error_map.numbers(shown).items()}
    (low,), (high,) = numbers["slice/v_y from"], numbers["slice/v_y to"]
    assert high - low == pytest.approx(np.ptp(evaluation.x0[:, 1]) / 3)
    within = (evaluation.x0[:, 1] >= low) & (evaluation.x0[:, 1] <= high)
    assert 20 < len(numbers["bin/mean rmse"]) < 100
    for i, mean in enumerate(numbers["bin/mean rmse"]):
        inside = within.copy()
        for name, state in (("v_x", 0), ("yaw_rate", 2)):
            start, end = numbers[f"bin/{name} from"][i], numbers[f"bin/{name} to"][i]
            inside &= (evaluation.x0[:, state] >= start) & (evaluation.x0[:, state] <= end)
        assert inside.sum() == numbers["bin/states"][i] >= 3
        assert evaluation.rmse[inside].mean() == pytest.approx(mean)
    cut, space, _bar = error_map.draw(shown).axes
    (mesh,), (balls,) = cut.collections, space.collections
    assert mesh.get_array().compressed() == pytest.approx(numbers["bin/mean rmse"])
    assert np.sort(np.asarray(balls._offsets3d)) == pytest.approx(np.sort(evaluation.x0.T))
    assert (np.diff(shown.balls.rmse) >= 0).all()
    assert balls.get_facecolors()[:, 3].min() < 0.5 < balls.get_facecolors()[:, 3].max()  # small ones hide nothing


def of_many(n):
    """Fields of an evaluation of ``n`` states in a ball, errors that fall with the speed."""
    x0 = np.random.default_rng(0).normal(size=(n, 3))
    x0 *= (10 * np.cbrt(np.linspace(0.01, 1, n)) / np.linalg.norm(x0, axis=1))[:, np.newaxis]
    whole = {"distance": np.linspace(0.0, 1.0, n) ** 2, "outside": np.arange(n) % 50 == 0}
    return {"x0": x0, "rmse": 30 / (1 + np.abs(x0[:, 0])), "diverged": np.zeros(n, dtype=bool), **whole}


def test_the_side_has_the_training_trajectories(made):
    shown = shown_by(error_side, made)
    side, _bar = error_side.draw(shown).axes
    paths = [c for c in side.collections if len(c.get_paths()) == 25]
    assert paths[0].get_segments()[3] == pytest.approx(made["training"].x[3][:, [1, 2]])
    balls = [c for c in side.collections if len(c.get_offsets()) == 60]
    assert balls[0].get_offsets().tolist() == shown.balls.x0[:, [1, 2]].tolist()
    assert balls[0].get_array().tolist() == shown.balls.rmse.tolist()
    assert "rad/s" in side.get_ylabel()
    numbers = error_side.numbers(shown)
    assert numbers["training trajectory"].values.max() == 24
    assert numbers["training v_x"].values.reshape(25, -1)[3].tolist() == made["training"].x[3][:, 0].tolist()


def test_many_training_trajectories_are_thinned(made, monkeypatch):
    monkeypatch.setattr(error_side, "PATHS", 10)
    assert len(shown_by(error_side, made).paths) == 9  # every third of 25


def test_the_trajectory_nearest_the_mean_and_its_offset_at_the_start(made):
    evaluation = made["evaluation"]
    shown = shown_by(mean_trajectory, made)
    j = int(np.abs(evaluation.rmse - evaluation.rmse.mean()).argmin())
    assert shown.true.tolist() == made["trajectories"].x[j].tolist()
    assert shown.rmse == evaluation.rmse[j]
    error = 100 * np.linalg.norm(shown.predicted - shown.true) / np.linalg.norm(shown.true)
    assert error == pytest.approx(shown.rmse)
    figure = mean_trajectory.draw(shown)
    assert len(figure.axes) == 3
    for i, axes in enumerate(figure.axes):
        true, predicted, *starts = axes.lines
        assert true.get_ydata().tolist() == shown.true[:, i].tolist()
        assert predicted.get_ydata().tolist() == shown.predicted[:, i].tolist()
        assert [line.get_ydata()[0] for line in starts] == [shown.true[0, i], shown.predicted[0, i]]
    assert figure.axes[0].get_ylabel() == "$v_{x}$ (m/s)"
    assert figure.axes[2].get_ylabel() == "yaw rate (rad/s)"


def test_the_histogram_holds_every_trajectory(made):
    (shown,) = shown_by(rmse_histogram, made)
    assert shown.share.sum() == pytest.approx(100)
    assert shown.mean == pytest.approx(made["evaluation"].rmse.mean())
    first, last = (made["evaluation"].rmse < shown.edges[1]).sum(), (made["evaluation"].rmse >= shown.edges[-2]).sum()
    assert shown.share[[0, -1]] == pytest.approx(np.array([first, last]) / 0.6)
    axes = rmse_histogram.draw([shown]).axes[0]
    assert [line.get_xdata()[0] for line in axes.lines] == [shown.mean, shown.median]
    assert axes.get_xscale() == "log"


def test_a_histogram_of_equal_errors(made):
    for value in (0.0, 5.0):
        same = replace(made["evaluation"], rmse=np.full(60, value))
        (shown,) = shown_by(rmse_histogram, {"evaluation": same})
        assert shown.share.sum() == pytest.approx(100)
        rmse_histogram.draw([shown])


def test_the_error_over_time_is_the_rmse_taken_apart(made):
    """The root mean square over time of the error at each sample is the RMSE of the trajectory."""
    one = {**made, "evaluation": evaluate(made["predictor"], made["trajectories"], slice(None), 0)}
    (shown,) = shown_by(horizon, one)
    assert len(shown.time) == 11
    assert (shown.lower <= shown.median).all()
    assert (shown.median <= shown.upper).all()
    single = replace(made["trajectories"], x=made["trajectories"].x[:1], u=made["trajectories"].u[:1])
    alone = {**made, "trajectories": single, "evaluation": evaluate(made["predictor"], single, slice(None), 0)}
    (of_one,) = shown_by(horizon, alone)
    assert np.sqrt((of_one.median**2).mean()) == pytest.approx(made["evaluation"].rmse[0])


def test_several_horizons_are_named_at_the_ends_of_their_lines(made):
    """The first thick and in colour, the others grey; no name lies over another although the lines end in one place."""
    curves = shown_by(horizon, made, made, made)
    figure = horizon.draw(curves)
    (axes,) = figure.axes
    assert not figure.legends
    assert not axes.collections  # no bands
    names = [f"predictor {i}" for i in range(3)]
    drawn, leaders = axes.lines[:3], axes.lines[3:]
    assert [line.get_label() for line in drawn] == [text.get_text() for text in axes.texts] == names
    own, *others = drawn
    assert own.get_linewidth() > 2 * max(line.get_linewidth() for line in others)
    red, green, blue = np.array([to_rgb(line.get_color()) for line in others]).T
    assert (red == green).all()
    assert (green == blue).all()
    for leader, curve in zip(leaders, curves, strict=True):
        end = axes.transAxes.transform(leader.get_xydata()[0])
        assert axes.transData.inverted().transform(end) == pytest.approx([curve.time[-1], curve.median[-1]])
    figure.draw_without_rendering()
    places = sorted(text.get_window_extent().intervaly.tolist() for text in axes.texts)
    assert all(below[1] < above[0] for below, above in pairwise(places))


def test_one_horizon_names_its_median_and_the_ends_of_its_band(made):
    (axes,) = horizon.draw(shown_by(horizon, made)).axes
    assert [text.get_text() for text in axes.texts] == ["90 % are below", "median", "10 % are below"]
    assert len(axes.collections) == 1


@pytest.mark.parametrize(
    ("wanted", "heights", "places"),
    [
        ([0.2, 0.6], [0.1, 0.1], [0.2, 0.6]),  # nothing in the way
        ([0.5, 0.5], [0.2, 0.2], [0.4, 0.6]),
        ([0.52, 0.5], [0.2, 0.2], [0.61, 0.41]),  # in their order
        ([0.9, 2.0], [0.2, 0.2], [0.7, 0.9]),  # back from the edge
        ([0.5, 0.5, 0.5, 0.1], [0.1, 0.1, 0.1, 0.1], [0.4, 0.5, 0.6, 0.1]),
    ],
)
def test_names_stand_as_near_to_their_ends_as_they_can(wanted, heights, places):
    assert apart(np.array(wanted), np.array(heights)) == pytest.approx(places)


def test_predictors_side_by_side(made):
    worse = {**made, "evaluation": replace(made["evaluation"], rmse=2 * made["evaluation"].rmse)}
    one, other = shown_by(compare, made, worse)
    assert other.quantiles == pytest.approx(2 * one.quantiles)
    assert one.quantiles[2] == np.median(made["evaluation"].rmse)
    axes = compare.draw([one, other]).axes[0]
    diamonds = [line for line in axes.lines if line.get_marker() == "D"]
    assert [d.get_xydata().ravel().tolist() for d in diamonds] == [[one.mean, 0], [other.mean, 1]]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert rows[0].startswith("predictor 0\nmean ")
    assert axes.get_ylim()[0] > axes.get_ylim()[1]  # the first on top
    lost = replace(made["evaluation"], diverged=np.arange(60) < 3)
    (counted,) = shown_by(compare, {"evaluation": lost})
    assert counted.diverged == 3
    assert "3 diverged" in compare.draw([counted]).axes[0].get_yticklabels()[0].get_text()


def test_bands_of_quantiles_end_where_the_data_end(made):
    """The quantiles of every group recomputed from the evaluation; groups of few states are joined."""
    evaluation = replace(made["evaluation"], **of_many(600))
    shown = shown_by(density, {"evaluation": evaluation})
    numbers = {name: array.values for name, array in density.numbers(shown).items()}
    low, high = numbers["group/distance from"], numbers["group/distance to"]
    assert (low[0], high[-1]) == (evaluation.distance.min(), evaluation.distance.max())
    assert low[1:].tolist() == high[:-1].tolist()
    for i in range(len(low)):
        last = i == len(low) - 1
        group = (evaluation.distance >= low[i]) & ((evaluation.distance < high[i]) | last)
        assert group.sum() >= density.FEWEST
        for q in (10, 25, 50, 75, 90):
            assert numbers[f"group/rmse {q} %"][i] == pytest.approx(np.percentile(evaluation.rmse[group], q))
    (axes,) = density.draw(shown).axes
    outer, inner, median = axes.patches
    for band, below, above in ((outer, 10, 90), (inner, 25, 75), (median, None, 50)):
        data = band.get_data()
        assert data.edges.tolist() == [*low, high[-1]]
        assert data.values.tolist() == numbers[f"group/rmse {above} %"].tolist()
        assert below is None or data.baseline.tolist() == numbers[f"group/rmse {below} %"].tolist()
    (marks,) = axes.lines
    assert len(marks.get_xdata()) == evaluation.outside.sum() == 12


def test_few_states_are_one_group(made):
    shown = shown_by(density, {"evaluation": replace(made["evaluation"], **of_many(25))})
    assert shown.quantiles.shape == (5, 1)


@pytest.mark.parametrize("mesh", ["sphere", "fibonacci"])
def test_the_states_tell_their_surface(slips, mesh):
    points = sampling.MESHES[mesh](49)
    axes = np.array([20.0, 10.0, 5.0])
    sample = Sample((), points * axes, np.zeros((49, 1, 4)), False, slips.states, slips.inputs)
    shown = shown_by(energy_surface, {"sample": sample})
    assert shown.semi_axes == pytest.approx(axes)
    figure = energy_surface.draw(shown)
    seen = [c for c in figure.axes[0].collections if hasattr(c, "_offsets3d")]
    assert sum(len(c._offsets3d[0]) for c in seen) == 49
    inside = replace(sample, states=sample.states * np.linspace(0.5, 1, 49)[:, np.newaxis])
    with pytest.raises(InvalidValueError, match="one kinetic energy"):
        shown_by(energy_surface, {"sample": inside})


def test_they_do_not_ask_for_the_method(made):
    basis = edmd.FitEdmd.of(basis="states").basis_from(made["training"])
    dmd = edmd.fit(made["training"], basis)
    other = {**made, "predictor": dmd, "evaluation": evaluate(dmd, made["trajectories"], slice(None), 0)}
    for module in (error_map, error_side, mean_trajectory, rmse_histogram, horizon, compare, density):
        assert module.draw(shown_by(module, other))
