"""The figures of an evaluation: what is drawn, not how it looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.config.settings import ImageFormat, Series
from koopcli.errors import InvalidValueError
from koopcli.figures import error_map, mean_trajectory
from koopcli.koopman import edmd
from koopcli.koopman.evaluation import evaluate
from tests.conftest import ball_of, surface_of, trajectories_of

SERIES = [Series("eigenfunctions, optimal", None)]


@pytest.fixture(scope="module")
def made(vehicle):
    from koopcli.koopman.eigenfunctions import fit
    from koopcli.vehicles.single_track import SlipInput

    plant = SlipInput(vehicle)
    training, test = trajectories_of(plant, surface_of(plant), 30), trajectories_of(plant, ball_of(plant, 60), 10)
    settings = {"degree": 2, "boundary": "optimal", "centres": 1, "seed": 0, "scaling": "raw", "cut": 1e-8}
    predictor = fit(training, **settings, tabulated=20)
    return {
        "0/training": training,
        "0/trajectories": test,
        "0/predictor": predictor,
        "0/evaluation": evaluate(predictor, test, slice(None), 0),
    }


def test_every_initial_state_with_its_error(made):
    shown = error_map.error_map(made["0/evaluation"], made["0/training"])
    assert (np.diff(shown.rmse) >= 0).all()  # the largest lie on top
    figure = error_map.draw(shown)
    top, side, bar = figure.axes
    balls = [c for c in top.collections if len(c.get_offsets()) == 60]
    assert balls[0].get_offsets().tolist() == shown.x0[:, :2].tolist()
    assert balls[0].get_array().tolist() == shown.rmse.tolist()
    assert (np.diff(balls[0].get_sizes()) >= 0).all()
    assert "m/s" in top.get_xlabel()
    assert "rad/s" in side.get_ylabel()
    assert "RMSE (%)" in bar.get_ylabel()
    paths = [c for c in side.collections if len(c.get_paths()) == 25]
    assert paths[0].get_segments()[3] == pytest.approx(made["0/training"].x[3][:, [1, 2]])


def test_many_training_trajectories_are_thinned(made, monkeypatch):
    monkeypatch.setattr(error_map, "PATHS", 10)
    assert len(error_map.error_map(made["0/evaluation"], made["0/training"]).paths) == 9  # every third of 25


def test_the_trajectory_nearest_the_mean(made):
    evaluation = made["0/evaluation"]
    shown = mean_trajectory.mean_trajectory(evaluation, made["0/predictor"], made["0/trajectories"])
    j = int(np.abs(evaluation.rmse - evaluation.rmse.mean()).argmin())
    assert shown.true.tolist() == made["0/trajectories"].x[j].tolist()
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
    assert figure.axes[2].get_xlabel() == "time (s)"
    assert figure.axes[0].get_ylabel() == "$v_{x}$ (m/s)"
    assert figure.axes[2].get_ylabel() == "yaw rate (rad/s)"


@pytest.mark.parametrize("module", [error_map, mean_trajectory])
@pytest.mark.parametrize("image", ImageFormat.__args__)
def test_the_same_records_give_the_same_bytes(made, module, image):
    assert module.drawing(SERIES, made, image).image == module.drawing(SERIES, made, image).image


@pytest.mark.parametrize("module", [error_map, mean_trajectory])
def test_an_evaluation_without_any_error_is_refused(made, module):
    lost = replace(made["0/evaluation"], diverged=np.ones(60, dtype=bool))
    with pytest.raises(InvalidValueError, match="every prediction of this evaluation diverged"):
        module.drawing(SERIES, {**made, "0/evaluation": lost}, "png")


def test_they_do_not_ask_for_the_method(made):
    basis = edmd.basis_from_data(made["0/training"], "states", 1)
    dmd = edmd.fit(made["0/training"], basis)
    other = {**made, "0/predictor": dmd, "0/evaluation": evaluate(dmd, made["0/trajectories"], slice(None), 0)}
    for module in (error_map, mean_trajectory):
        assert module.drawing(SERIES, other, "png").image
