from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from koopcli.errors import InvalidValueError
from koopcli.koopman.edmd import fit as edmd
from koopcli.koopman.predictor.dynamics.bilinear import Bilinear
from koopcli.koopman.scores.evaluation import Evaluation, evaluate, join
from koopcli.vehicles.plants.slips import SlipInput
from tests.conftest import ball_of, box_sample, eigen_fit, grid_sample, surface_of, trajectories_of


@pytest.fixture(scope="module")
def pair(plant):
    data = trajectories_of(plant, grid_sample(count=7, columns=3), 1)
    predictor = edmd.fit(data, edmd.FitEdmd.of(basis="tensor", order=3).basis_from(data))
    return predictor, trajectories_of(plant, box_sample(50, steps=8), 8)


def wild(predictor):
    """The predictor, its lifted state a million times as large after every step."""
    return replace(predictor, dynamics=replace(predictor.dynamics, A=1e6 * predictor.dynamics.A))


def test_parts_join_to_the_whole(pair):
    whole = evaluate(*pair, slice(None), 1)
    parts = join([evaluate(*pair, slice(i, i + 13), 1) for i in range(0, 50, 13)])
    assert parts.rmse == pytest.approx(whole.rmse, rel=1e-12)
    assert parts.rmse_relift == pytest.approx(whole.rmse_relift, rel=1e-12)
    assert parts.pack().meta == whole.pack().meta
    again = Evaluation.unpack(whole.pack())
    assert again.figures() == whole.figures()


def test_relifting_is_the_rolled_one_step_predictor(pair):
    predictor, test = pair
    x = [test.x[:, 0]]
    for k in range(8):
        x.append(predictor.predict(x[-1], test.u[:, k : k + 1])[:, 1])
    error = np.sqrt(((np.stack(x, axis=1) - test.x)[:, 1:] ** 2).sum((1, 2)))
    expected = 100 * error / np.sqrt((test.x[:, 1:] ** 2).sum((1, 2)))
    assert evaluate(predictor, test, slice(None), 1).rmse_relift == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("restart", [4, 5, 10, 25])
def test_predictions_that_restart_are_scored_one_by_one(pair, plant, restart):
    """Each stretch is a trajectory of its own; the last is shorter where they do not come out even."""
    predictor, _ = pair
    test = trajectories_of(plant, box_sample(3), 10)
    found = evaluate(predictor, test, slice(None), 1, restart)
    starts = list(range(0, 10, restart))
    assert found.start.tolist() == starts * 3
    for i in range(3):
        for j, k in enumerate(starts):
            part = replace(test, x=test.x[i : i + 1, k : k + restart + 1], u=test.u[i : i + 1, k : k + restart])
            alone = evaluate(predictor, part, slice(None), 1)
            row = i * len(starts) + j
            assert found.rmse[row] == pytest.approx(alone.rmse[0], rel=1e-9)
            assert found.x0[row] == pytest.approx(test.x[i, k])
    figures = found.figures()
    assert figures["trajectories"] == 3
    assert [segment["start"] for segment in figures["segments"]] == starts
    assert figures["segments"][-1]["rmse"] == pytest.approx(found.rmse[found.start == starts[-1]].mean())
    header, rows = found.table()
    assert header[0] == "start (samples)"
    assert [row[0] for row in rows] == starts * 3
    assert (Evaluation.unpack(found.pack()).start == found.start).all()


def test_the_score_inside_the_training_box(pair):
    predictor, test = pair
    found = evaluate(predictor, test, slice(None), 1)
    inside = ((test.x[:, 1:] >= predictor.coverage.domain[0]) & (test.x[:, 1:] <= predictor.coverage.domain[1])).all(
        axis=(1, 2)
    )
    figures = found.figures()
    assert 0 < inside.sum() < len(test)
    assert figures["trajectories_in_domain"] == inside.sum()
    assert figures["rmse_in_domain"]["mean"] == pytest.approx(found.rmse[inside].mean())


def test_a_diverged_prediction_is_counted_and_left_out(pair):
    predictor, test = pair
    figures = evaluate(wild(predictor), test, slice(None), 1).figures()
    assert figures["diverged"] == 50
    assert np.isnan(figures["rmse"]["mean"])
    u = np.array(test.u)
    u[3] = 1e300
    figures = evaluate(predictor, replace(test, u=u), slice(None), 1).figures()
    assert figures["diverged"] == 1
    assert np.isfinite(figures["rmse"]["max"])


def test_a_diverged_relift_is_counted_by_itself(pair):
    predictor, test = pair
    whole = evaluate(predictor, test, slice(None), 1)
    some = np.zeros(50, dtype=bool)
    some[:20] = True
    figures = replace(whole, diverged_relift=some, rmse_relift=np.where(some, np.inf, whole.rmse_relift)).figures()
    assert (figures["diverged"], figures["diverged_relift"]) == (0, 20)
    assert figures["rmse_relift"]["max"] == whole.rmse_relift[20:].max()
    assert evaluate(wild(predictor), test, slice(None), 1).figures()["diverged_relift"] == 50


def test_what_does_not_fit_is_refused(pair):
    predictor, test = pair
    with pytest.raises(InvalidValueError, match=r"steps by 0\.01 s, the trajectories by 0\.02 s"):
        evaluate(predictor, replace(test, dt=0.02), slice(None), 1)
    with pytest.raises(InvalidValueError, match="at most 8 steps"):
        evaluate(predictor, test, slice(None), 9)
    with pytest.raises(InvalidValueError, match="different states"):
        evaluate(replace(predictor, state_channels=predictor.input_channels), test, slice(None), 1)


def test_the_table_has_a_row_for_each_trajectory(pair):
    evaluation = evaluate(*pair, slice(None), 1)
    header, rows = evaluation.table()
    assert len(rows) == 50
    assert all(len(row) == len(header) for row in rows)
    assert rows[7][header.index("rmse (%)")] == evaluation.rmse[7]


@pytest.fixture(scope="module")
def looked_up(vehicle):
    """A predictor whose value at k = 0 is an approximation."""
    plant = SlipInput(vehicle)
    data = trajectories_of(plant, surface_of(plant, 49), 30)
    predictor = eigen_fit(data, boundary="optimal", cut=1e-8, tabulated=20)
    return predictor, trajectories_of(plant, ball_of(plant, 60), 10)


def test_the_error_at_the_start_and_the_first_sample_that_counts(looked_up, pair):
    predictor, test = looked_up
    scored = evaluate(predictor, test, slice(None), 0)
    predicted = predictor.predict(test.x[:, 0], steps=10)
    size = np.linalg.norm(test.x[:, 0], axis=1)
    assert scored.start_error == pytest.approx(100 * np.linalg.norm(predicted[:, 0] - test.x[:, 0], axis=1) / size)
    assert scored.start_error.min() > 0.1
    error = np.sqrt(((predicted - test.x) ** 2).sum((1, 2)) / (np.asarray(test.x) ** 2).sum((1, 2)))
    assert scored.rmse == pytest.approx(100 * error)
    assert (evaluate(predictor, test, slice(None), 1).rmse != scored.rmse).all()
    assert evaluate(*pair, slice(None), 1).start_error.max() < 1e-9  # EDMD holds the states themselves


def test_relifting_starts_from_the_state_that_is_known(looked_up):
    predictor, test = looked_up
    x = [predictor.predict(test.x[:, 0], steps=0)[:, 0]]
    at = np.asarray(test.x[:, 0])
    for _ in range(10):
        at = predictor.predict(at, steps=1)[:, 1]
        x.append(at)
    error = np.sqrt(((np.stack(x, axis=1) - test.x) ** 2).sum((1, 2)) / (np.asarray(test.x) ** 2).sum((1, 2)))
    assert evaluate(predictor, test, slice(None), 0).rmse_relift == pytest.approx(100 * error, rel=1e-9)


def test_where_the_test_states_are(looked_up):
    predictor, test = looked_up
    scored = evaluate(predictor, test, slice(None), 0)
    table, domain = predictor.observables.states.reshape(-1, 3), predictor.coverage.domain
    half = (domain[1] - domain[0]) / 2
    brute = [np.sqrt((((x - table) / half) ** 2).sum(axis=1)).min() for x in scored.x0]
    assert scored.distance == pytest.approx(np.array(brute))
    assert 0 < scored.outside.sum() < 60
    figures = scored.figures()
    worst, emptiest = scored.rmse.argsort()[-3:], scored.distance.argsort()[-3:]
    assert figures["worst_in_emptiest"] == pytest.approx(len(set(worst) & set(emptiest)) / 3)
    assert figures["outside"] == scored.outside.sum()


def test_the_largest_errors_and_the_share_in_the_domain(pair):
    predictor, test = pair
    scored = evaluate(predictor, test, slice(None), 1)
    predicted = predictor.predict(test.x[:, 0], test.u)
    assert scored.max_error == pytest.approx(np.abs(predicted - test.x)[:, 1:].max(axis=1))
    low, high = predictor.coverage.domain
    inside = ((test.x >= low) & (test.x <= high)).all(axis=2)[:, 1:]
    assert scored.in_domain == pytest.approx(inside.mean(axis=1))
    assert 0 < scored.in_domain.mean() < 1


def test_diverged_and_undefined_rows_stay_out_of_every_figure(pair):
    scored = evaluate(*pair, slice(None), 1)
    lost = np.zeros(50, dtype=bool)
    lost[scored.rmse.argmax()] = True
    rmse = np.where(np.arange(50) == scored.rmse.argmin(), np.nan, scored.rmse)
    figures = replace(scored, diverged=lost, rmse=rmse).figures()
    assert (figures["diverged"], figures["undefined"]) == (1, 1)
    assert figures["rmse"]["max"] == np.sort(scored.rmse)[-2]
    near = replace(scored, diverged=lost, distance=scored.rmse).figures()
    assert near["worst_in_emptiest"] == 1.0


def test_progress_moves_within_one_prediction(pair):
    """One long trajectory is one row: without steps in between its bar would stand still until the end."""
    predictor, test = pair
    linear = predictor.dynamics
    bilinear = replace(predictor, dynamics=Bilinear(linear.A, linear.B, np.zeros((4, 64, 64))))
    for one, halves in ((predictor, 1), (bilinear, 2)):
        told = []
        part = replace(test, x=test.x[:1], u=test.u[:1])
        evaluate(one, part, slice(None), 1, progress=lambda done, total, told=told: told.append(done / total))
        assert told == sorted(told)
        assert told[-1] == 1
        assert len(set(told)) >= 8 * halves
