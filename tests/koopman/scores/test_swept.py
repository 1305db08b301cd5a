from __future__ import annotations

import numpy as np
import pytest

from koopcli.koopman.scores.swept import SCORES, Swept, swept


def figures(mean, functions=8):
    score = {"mean": mean, "std": 1.0, "median": mean / 2, "max": 2 * mean}
    return {
        **{error: score for error, _ in SCORES.values()},
        "functions": functions,
        "trajectories": 10,
        "diverged": 0,
    }


@pytest.fixture
def table():
    places = [(0, 0, 0), (0, 0, 1), (1, 0, 0), (1, 0, 1), (-1, 1, -1)]
    means = [5.0, 7.0, 2.0, 3.0, float("nan")]
    values = [("1", "2"), ("tensor", "states"), ("0", "1")]
    return swept(["fit-edmd.order", "fit-edmd.basis", "sample.seed"], values, places, [figures(m) for m in means])


def test_the_best_cell_and_what_it_is(table):
    found = table.figures()
    assert found["cells"] == 5
    assert found["best"]["settings"] == {"fit-edmd.order": "2", "fit-edmd.basis": "tensor", "sample.seed": "0"}
    assert found["best"]["mean"] == 2.0
    assert table.told(4) == {"fit-edmd.basis": "states"}


def test_seeds_are_repetitions(table):
    assert table.groups() == [[0, 1], [2, 3], [4]]


def test_the_table_has_a_row_for_each_cell_and_nothing_where_there_is_nothing(table):
    header, rows = table.table()
    assert header[:4] == ["fit-edmd.order", "fit-edmd.basis", "sample.seed", "mean (%)"]
    assert rows[0][:4] == ["1", "tensor", "0", 5]
    assert rows[4][:4] == ["", "states", "", ""]
    assert all(len(row) == len(header) for row in rows)


def test_it_survives_storage(table):
    again = Swept.unpack(table.pack())
    assert again.table() == table.table()
    assert again.figures() == table.figures()


def test_where_all_diverged_there_is_no_best():
    lost = swept(["fit-edmd.order"], [("1",)], [(0,)], [figures(float("nan"))])
    assert lost.best is None
    assert lost.figures()["best"] is None
    assert np.isnan(lost.scores["mean"]).all()
