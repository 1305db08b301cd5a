"""Eigenfunctions beyond the paper: the ladder from its error to the best, what each step costs, and what it buys."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from koopcli.config.experiment import Experiment
from koopcli.koopman.eigen.futures import Futures
from koopcli.koopman.predictor.predictor import Predictor
from koopcli.koopman.predictor.trust import LEVEL
from koopcli.koopman.scores.metrics import rmse
from koopcli.records import FloatArray, Meta
from koopcli.reproduction import beyond_cells as blocks
from koopcli.reproduction import headlines
from koopcli.reproduction.eigen import FIXED
from koopcli.reproduction.eigen_cells import ball, surface
from koopcli.reproduction.layout import Column, by_vehicle, columns, labelled, score_texts, vehicle_table
from koopcli.reproduction.report import REDUCED, Method, Picture, Run, Scored, Table, drawer
from koopcli.reproduction.texts import count_text, number_text, score_text
from koopcli.simulation.samples.ball import BallSample
from koopcli.simulation.samples.ellipsoid import EllipsoidSample
from koopcli.stages import recipes
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline

LIFTED = 20  # states that are lifted one by one to see how long a control step would wait
PARTS = {
    "alone": "the composed futures alone",
    "floor": "the true trajectories in the comb of rates",
}  # what is measured of a lift of futures
SHIPPED = {recipes.QUICK: blocks.quick, recipes.BEST: blocks.best}
TENFOLD = 10.0  # how much worse EDMD on the same data is expected to be

NOTES = (
    "A comb of rates needs no data: 22 exponentials hold half a second of any of these cars, where the lattice of "
    "three rates has about nine directions that can be told apart.",
    "Shells and volumes leave the theory of eigenfunctions from a surface that is never met again: where trajectories "
    "from several energies meet, an eigenfunction has several values, and the lift blends them. What stays is a "
    "linear system whose lifted state holds the half second ahead.",
    "World coordinates know that a velocity turns with the car, and nothing of its tyres; mirror images that the car "
    "is the same to the left and to the right. Neither costs a simulated second.",
    "Continuation: the last half second of a trajectory has no whole future, so its samples could not be looked up. "
    "The predictor made without them says how each trajectory goes on, and then they can.",
    "Composed lookups: best-eigen looks up a twentieth of a second, moves there and looks up again, ten times. Its "
    "lift is a simulator made of data, and the linear system encodes what it says. quick-eigen looks up half a second "
    "once.",
    "Noise is normal on every sample, on the yaw rate a tenth of it in rad/s, and the fit is not told; coloured noise "
    "keeps 0.8 of itself from sample to sample. The fit smooths by itself where it sees noise, and its splines are as "
    "soft as held-back trajectories say. Test trajectories have none.",
    "Rates, lift and design were chosen on ctu-2020 and rimac-2018 with test states of other seeds than those shown; "
    "the vehicles of the last table were not looked at before.",
)


def tables(runs: Sequence[Run]) -> list[Table]:
    """The ladder with its costs, budgets and EDMD; what is left of the error; the ablation; modes; vehicles not seen
    before; noise; trust.
    """
    shown, unseen = columns(runs), columns(runs, blocks.unseen)
    first = runs[0]
    left = _parts(first, shown)
    seen = [_unseen(first, unseen), _noise(first, shown), _trust(runs)]
    return [_ladder(first, shown), left, _ablation(shown), _modes(shown), *seen]


def _ladder(first: Run, shown: Sequence[Column]) -> Table:
    seeds, rows = _seeds(first), []
    for block in (blocks.LADDER, blocks.BUDGETS, blocks.EDMD):
        lines = by_vehicle(shown, block, "label", "design", "simulated", "seed")
        for label, design, simulated in dict.fromkeys(key[:-1] for key in lines):
            scores = [lines[label, design, simulated, seed] for seed in seeds]
            scored = next(filter(None, scores[0]), None)
            below = map("\n".join, zip(*map(score_texts, scores), strict=True))
            rows.append([design, label, f"{simulated:.0f}", *_costs(scored), *below])
    queries = f"{count_text(ball(first.experiment).count)} queries (s)"
    header = ["initial states", "rates, lift", "simulated (s)", "lifted states", "build (s)", queries, "one state (ms)"]
    header += [column.heading for column in shown]
    suffix = "" if len(seeds) < 2 else f", seeds {' and '.join(map(str, seeds))} below one another"
    return Table(f"Beyond the paper: RMSE in %, mean ± std (median){suffix}", header, rows, left=2)


def _costs(scored: Scored | None) -> list[str]:
    if scored is None:
        return ["–", "–", "–", "–"]
    seconds = [scored.measured.get(name, math.nan) for name in ("build", "query", "one")]
    return [str(scored.figures["functions"]), *(number_text(value, 2) for value in seconds)]


def _ablation(shown: Sequence[Column]) -> Table:
    best = [_known(column, blocks.best, _seeds(column.run)[0]) for column in shown]
    rows = [["nothing: best-eigen", *map(score_text, best)], *labelled(shown, blocks.ABLATION)]
    return vehicle_table("One ingredient taken away: RMSE in %, mean ± std (median)", ["instead"], shown, rows)


def _modes(shown: Sequence[Column]) -> Table:
    rows = [
        [label, str(modes), *(_missed(scored) for scored in scores)]
        for (label, modes), scores in by_vehicle(shown, blocks.MODES, "label", "modes").items()
    ]
    title = "How many modes: what the fit misses of the data / RMSE, in %"
    return vehicle_table(title, ["rates", "modes"], shown, rows)


def _missed(scored: Scored | None) -> str:
    assert scored is not None, "every vehicle has as many modes"
    return f"{number_text(scored.measured['missed'])} / {number_text(scored.figures['rmse']['mean'])}"


def _parts(first: Run, shown: Sequence[Column]) -> Table:
    """Of the last rung: what its futures miss before they are lifted, and what no lift could avoid."""
    lines = by_vehicle(shown, blocks.LADDER, "label", "seed")
    rows = []
    for seed in _seeds(first):
        scores = lines.get((blocks.BEST_LABEL, seed), [])
        rows.append([f"best-eigen, seed {seed}", *(_mean(scored) for scored in scores)])
        for name, about in PARTS.items():
            texts = ["–" if scored is None else number_text(scored.measured.get(name, math.nan)) for scored in scores]
            rows.append([f"{about}, seed {seed}", *texts])
    return vehicle_table("Where the error of best-eigen comes from: mean RMSE in %", ["what"], shown, rows)


def _mean(scored: Scored | None) -> str:
    return "–" if scored is None else number_text(scored.figures["rmse"]["mean"])


def _unseen(first: Run, shown: Sequence[Column]) -> Table:
    seeds = _seeds(first)
    rows = [
        [column.heading, name, *(score_text(_known(column, task, seed)) for seed in seeds)]
        for column in shown
        for name, task in SHIPPED.items()
    ]
    header = ["vehicle", "predictor", *(f"seed {seed}" for seed in seeds)]
    return Table("Vehicles that nothing was chosen on: RMSE in %", header, rows, left=2)


def _noise(first: Run, shown: Sequence[Column]) -> Table:
    seeds = _seeds(first)
    lines, rows = by_vehicle(shown, blocks.NOISE, "noise", "label", "seed"), []
    for noise, label in dict.fromkeys(key[:-1] for key in lines):
        scores = [lines[noise, label, seed] for seed in seeds]
        errors = map("\n".join, zip(*map(score_texts, scores), strict=True))
        covered = ["\n".join(map(_covered, of_vehicle)) for of_vehicle in zip(*scores, strict=True)]
        rows.append([noise, label, *(text for pair in zip(errors, covered, strict=True) for text in pair)])
    header = ["noise (m/s)", "predictor"]
    for column in shown:
        header += [column.heading, "within bounds (%)"]
    suffix = "" if len(seeds) < 2 else f", seeds {' and '.join(map(str, seeds))} below one another"
    return Table(f"Noise in the training trajectories: RMSE in %, mean ± std (median){suffix}", header, rows, left=2)


def _covered(scored: Scored | None) -> str:
    bound = None if scored is None else scored.figures["bound"]
    return "–" if bound is None else f"{100 * bound['covered']:.1f}"


def _trust(runs: Sequence[Run]) -> Table:
    shown = columns(runs, lambda experiment: [*recipes.vehicles(experiment), *blocks.unseen(experiment)])
    rows = []
    for (column, seed), (name, task) in product(_tested(shown), SHIPPED.items()):
        figures = _known(column, task, seed)
        if figures is not None and (bound := figures["bound"]) is not None:
            covered = f"{100 * bound['covered']:.1f}"
            rows.append([column.heading, name, str(seed), covered, number_text(bound["median"])])
    header = ["vehicle", "predictor", "seed", "errors within their bounds (%)", "median bound (%)"]
    return Table(f"Trust: {100 * LEVEL:.0f} % bounds on the error from each test state", header, rows, left=2)


def notes(runs: Sequence[Run]) -> list[str]:
    """What the tables mean, and which of the expectations a run does not meet."""
    notes = list(NOTES)
    for column, seed in _tested(columns(runs)):
        best = _known(column, blocks.best, seed)
        tasks = {row.label: blocks.evaluated(row, column.experiment, seed) for row in blocks.beside(column.experiment)}
        scores = {label: column.run.known(task) for label, task in tasks.items()}
        means = {label: figures["rmse"]["mean"] for label, figures in scores.items() if figures is not None}
        if best is None or not means:
            continue
        nearest = min(means, key=lambda label: means[label])
        ratio = means[nearest] / best["rmse"]["mean"]
        text = f"{nearest} on the same trajectories without images is {ratio:.0f} times worse"
        if not ratio >= TENFOLD:
            text = f"{nearest} is only {ratio:.2g} times worse than best-eigen, not ten times"
        notes.append(f"{column.heading}, seed {seed}: {text}.")
    full = all(
        surface(run.experiment).count == EllipsoidSample.count and ball(run.experiment).count == BallSample.count
        for run in runs
    )
    return notes if full else [REDUCED, *notes]


def pictures(experiment: Experiment) -> list[Picture]:
    """The frontier; of every vehicle errors before and after, modes and trust; and what each ingredient buys."""
    draw, seed = drawer(experiment), experiment.reproduce.seeds[0]
    frontier, pictured = [], []
    for vehicle, own in recipes.vehicles(experiment):
        first, shells, quick, best = (
            blocks.evaluated(row(own), own, seed)
            for row in (blocks.first_row, blocks.shells_row, blocks.quick_row, blocks.best_row)
        )
        budgets, edmd, modes = (
            [blocks.evaluated(row, own, seed) for row in rows(own)]
            for rows in (blocks.budgets, blocks.beside, blocks.sweep)
        )
        frontier += [first, shells, quick, best, *budgets, *edmd[1:]]
        about = f"Errors by initial state, {vehicle}: the paper's surface, lattice and nearest sample, quick-eigen and "
        about += "best-eigen."
        labels = {first: "before", quick: recipes.QUICK, best: recipes.BEST}
        shipped = {best: recipes.BEST, quick: recipes.QUICK}
        taken = {best: "best-eigen", **{blocks.evaluated(row, own, seed): row.label for row in blocks.ablation(own)}}
        pictured += [
            Picture(draw("before-after", list(labels), labels=labels), about),
            *(
                Picture(draw("trust", [task]), f"Errors and the bounds given for them, {vehicle}, {name}.")
                for task, name in shipped.items()
            ),
            Picture(
                draw("horizon", list(shipped), labels=shipped),
                f"How errors grow with time, {vehicle}: one lookup, and lookups of a twentieth of a second.",
            ),
            Picture(draw("modes", modes), f"How many modes, {vehicle}."),
            Picture(draw("compare", list(taken), labels=taken), f"One ingredient taken away at a time, {vehicle}."),
        ]
    return [Picture(draw("frontier", frontier), "Error against simulated seconds."), *pictured]


def measure(pipeline: Pipeline, cell: blocks.BeyondCell, task: Task) -> Mapping[str, float]:
    """Seconds of the fit, when it was made, with those of building its lookup, and of predicting all test states, now;
    what it misses of the data.
    """
    fit = pipeline.make(task.input("predictor"))
    measured: dict[str, float] = {"build": float(fit.record.provenance["seconds"])}
    if isinstance(fit.content, Predictor) and fit.content.regression.missed is not None:
        measured["missed"] = fit.content.regression.missed
    if cell.block in (blocks.LADDER, blocks.BUDGETS, blocks.EDMD):
        test = pipeline.make(task.input("trajectories")).content
        x0, u = np.asarray(test.x[:, 0]), np.asarray(test.u[:])
        start = time.perf_counter()
        fit.content.predict(x0[:1], u[:1])  # a triangulation or a tree is built with the first question
        measured["build"] += time.perf_counter() - start
        start = time.perf_counter()
        fit.content.predict(x0, u)
        measured["query"] = time.perf_counter() - start
        start = time.perf_counter()
        for x in x0[:LIFTED]:
            fit.content.predict(x[np.newaxis], u[:1, :1])
        measured["one"] = 1e3 * (time.perf_counter() - start) / len(x0[:LIFTED])
        if cell.label == blocks.BEST_LABEL:
            measured |= _parts_of(fit.content, np.asarray(test.x[:]))
    return measured


def _parts_of(predictor: Predictor, x: FloatArray) -> dict[str, float]:
    """The mean errors of futures ``x`` (n, samples, n_x): of those that the lift composes, and of the true ones in the
    predictor's modes. The latter are known where ``x`` is as long as the horizon.
    """
    lift = predictor.observables
    assert isinstance(lift, Futures)
    samples = min(x.shape[1], lift.horizon + 1)
    parts = {"alone": float(rmse(lift.future(x[:, 0])[:, :samples], x[:, :samples]).mean())}
    if samples == lift.horizon + 1:
        reading = predictor.C[0, : len(lift.modes.rates)] @ lift.modes.powers(lift.horizon)
        held = np.matmul(reading @ lift.projection, x[:, :samples])
        parts["floor"] = float(rmse(held, x[:, :samples]).mean())
    return parts


def _known(column: Column, task: Callable[[Experiment, int], Task], seed: int) -> Meta | None:
    return column.run.known(task(column.experiment, seed))


def _tested(shown: Sequence[Column]) -> list[tuple[Column, int]]:
    """The vehicles of runs, each on the test states of each seed."""
    return [(column, seed) for column in shown for seed in _seeds(column.run)]


def _seeds(run: Run) -> tuple[int, ...]:
    return run.experiment.reproduce.seeds[:2]


METHOD = Method(
    name="beyond",
    title="eigenfunctions beyond the paper",
    cells=blocks.cells,
    tables=tables,
    notes=notes,
    pictures=pictures,
    lead=headlines.BEYOND,
    fixed=FIXED,
    measure=measure,
)
