"""The figures of an evaluation, most of them drawn for eigenfunctions: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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
from koopcli.figures.drawing import Source
from koopcli.koopman import edmd
from koopcli.koopman.bases import Choice
from koopcli.koopman.evaluation import evaluate
from koopcli.records import Sample
from koopcli.simulation import sampling
from koopcli.vehicles.single_track import SlipInput
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


def test_every_initial_state_with_its_error_the_largest_on_top(made):
    shown = shown_by(error_map, made)
    assert (np.diff(shown.rmse) >= 0).all()
    space, above, _bar = error_map.draw(shown).axes
    (balls,), (discs,) = space.collections, above.collections
    assert np.sort(np.asarray(balls._offsets3d)) == pytest.approx(np.sort(shown.x0.T))
    assert discs.get_offsets().tolist() == shown.x0[:, :2].tolist()
    assert (np.diff(discs.get_sizes()) >= 0).all()
    colours = discs.get_facecolors()
    assert (np.diff(colours[:, :3].sum(axis=1)) <= 1e-9).all()  # darker the larger
    assert balls.get_facecolors()[:, 3].min() < 0.5 < balls.get_facecolors()[:, 3].max()  # small ones hide nothing


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


def test_several_horizons_are_medians_told_apart(made):
    curves = shown_by(horizon, made, made)
    axes = horizon.draw(curves).axes[0]
    assert [line.get_label() for line in axes.lines] == ["predictor 0", "predictor 1"]
    assert not axes.collections  # no bands


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


def test_error_against_distance(made):
    evaluation = made["evaluation"]
    shown = shown_by(density, made)
    assert shown.distance.tolist() == evaluation.distance.tolist()
    assert len(shown.typical) == 20
    first = np.argsort(evaluation.distance)[:3]
    assert shown.typical[0] == pytest.approx([np.median(evaluation.distance[first]), np.median(evaluation.rmse[first])])
    axes = density.draw(shown).axes[0]
    drawn = sum(len(line.get_xdata()) for line in axes.lines if line.get_marker() in ("o", "^"))
    assert drawn == 60


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
    basis = edmd.basis_from_data(made["training"], Choice("states", 1))
    dmd = edmd.fit(made["training"], basis)
    other = {**made, "predictor": dmd, "evaluation": evaluate(dmd, made["trajectories"], slice(None), 0)}
    for module in (error_map, error_side, mean_trajectory, rmse_histogram, horizon, compare, density):
        assert module.draw(shown_by(module, other))
