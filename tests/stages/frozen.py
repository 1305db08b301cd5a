"""The store that later koops must read: small, and written once by the first code of its format.

``python -m tests.stages.frozen`` writes it where there is none; one that has been released is never written again.
"""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path

from koopcli.config.changes import parse_set
from koopcli.config.experiment import Experiment, load_experiment
from koopcli.config.grids import parse_grid
from koopcli.progress import silent
from koopcli.stages import figure_tasks, grid, pipeline, recipes
from koopcli.stages.base import Task
from koopcli.store import Store
from koopcli.store.pins import pin

STORE = Path(__file__).parents[1] / "golden" / "store"
PROVENANCE = {"time": "2026-11-27T00:00:00.000+00:00", "seconds": 0.0}
SMALL = (
    "sample.grid.count=5",
    "sample.grid.columns=2",
    "sample.ellipsoid.count=25",
    "sample.ellipsoid.steps=30",
    "fit-edmd.basis.tensor.order=2",
    "fit-eigen.tabulate=0.2",
    "fit-eigen.window.trajectory.boundary.thin-plate.centres=20",
    "test.box.count=20",
    "test.box.steps=5",
    "test.ball.count=20",
    "test.ball.steps=5",
)
AHEAD = (
    "fit-eigen.window=horizon",
    "fit-eigen.eigenvalues=comb",
    "fit-eigen.pairs=3",
    "fit-eigen.horizon=0.1",
    "fit-eigen.trust=true",
    "fit-eigen.lift=polyharmonic",
    "fit-eigen.neighbours=20",
    "fit-eigen.mirror=left-right",
)
OTHERS = {
    "greedy": ("sample.budget=0.6", "sample.steps=3", "sample.usable=0.02", "sample.candidates=50"),
    "drive": ("sample.count=3", "sample.steps=4", "vehicle.name=bmw-320i"),
    "manoeuvre": ("vehicle.name=bmw-320i", "sample.name=step-steer"),
    "point": ("sample.steps=5",),
}


def small(*assignments: str) -> Experiment:
    """The paper's experiment on few samples."""
    return load_experiment("paper", parse_set([*SMALL, *assignments]))


def tasks() -> list[Task]:
    """Something of every stage, and of every kind of dynamics."""
    plain, eigen = small(), recipes.fit_eigen(small("fit-eigen.lift=nearest"))
    scored = recipes.evaluation(plain)
    cells = grid.cells(
        parse_grid([*SMALL[:2], "fit-edmd.order=1,2", "test.box.count=20"]), None, "paper", lambda _: None
    )
    return [
        scored,
        recipes.evaluation(plain, eigen),
        recipes.evaluation(plain, recipes.baseline(plain, eigen.input("trajectories"))),
        recipes.fit_edmd(small("fit-edmd.terms=bilinear", "fit-edmd.basis=total", "fit-edmd.order=2")),
        recipes.fit_edmd(small("fit-edmd.terms=generator", "fit-edmd.basis=anisotropic", "fit-edmd.order=1")),
        recipes.fit_edmd(small("fit-edmd.basis=thin-plate", "fit-edmd.centres=9", "fit-edmd.placement=drawn")),
        recipes.fit_eigen(small(*AHEAD)),
        *(recipes.simulation(small(f"sample.kind={kind}", *more)) for kind, more in OTHERS.items()),
        grid.sweep(parse_grid([*SMALL[:2], "fit-edmd.order=1,2", "test.box.count=20"]), cells),
        figure_tasks.figure("rmse-histogram", [scored], "svg", plain),
    ]


class Silent:
    """A reporter that says nothing."""

    def note(self, text: str) -> None: ...

    def warn(self, text: str) -> None: ...

    @contextmanager
    def progress(self, label: str):
        yield silent


def main() -> None:
    assert not STORE.exists(), f"{STORE} is there, and stays as it is"
    pipeline.provenance = lambda seconds: PROVENANCE  # which machine wrote it is nobody's business
    store = Store(STORE)
    line = pipeline.Pipeline(store, Silent())
    records = [line.make(task).record for task in tasks()]
    pin(store, "kept", line.with_inputs(records))
    for name in ("locks", "tmp", "partial"):
        for path in sorted((STORE / name).rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        if (STORE / name).is_dir():
            (STORE / name).rmdir()


if __name__ == "__main__":
    main()
