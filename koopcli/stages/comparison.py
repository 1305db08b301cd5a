"""Paper versus here: the tables that a reproduction ends with, and what they mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.config.settings import BoxSample, GridSample
from koopcli.records import Meta
from koopcli.stages.reproduction import Sweep

INPUTS = {"none": "no input", "fresh": "fresh inputs", "held": "held inputs"}

NOTES = (
    "The paper does not state the test inputs behind its {paper} %, so three kinds are scored: none, ±{amplitude} N "
    "redrawn at each step (fresh), and ±{amplitude} N held over the trajectory.",
    "The fall with the order is the truncation of exp(-i r t) in the yaw rate r. The floor with inputs is not the "
    "basis: a constant B cannot hold the products of an input with powers of r, and even the exact free response with "
    "the best constant input response scores the same. So {paper} % is a statement about unstated inputs.",
    "The growth at high orders that the paper reports is that of a regression on raw monomials. In an orthonormal "
    "basis a smaller growth is left where training values are drawn at random: extrapolation beyond them in a few "
    "corners, which moves the mean and not the median.",
    "The paper states no yaw inertia either, and with held inputs the score follows it: --set vehicle.Jzz=1731 shows "
    "how far. No parameter was chosen to print the paper's figure.",
)
REDUCED = "This run is not of the paper's size: its figures cannot be put beside the paper's."


@dataclass(frozen=True)
class Table:
    """A table of texts."""

    title: str
    header: list[str]
    rows: list[list[str]]


def notes(sweeps: Sequence[tuple[str, Sweep]]) -> list[str]:
    """What the tables mean, beginning with a word on runs of another size than the paper's."""
    full = (_samples(GridSample()), _tests(BoxSample()))
    sizes = {(_samples(sweep.experiment.sample), _tests(sweep.experiment.test)) for _, sweep in sweeps}
    amplitudes = dict.fromkeys(f"{sweep.experiment.test.amplitude:g}" for _, sweep in sweeps)
    said = [note.format(paper=BEST_RMSE, amplitude=" or ".join(amplitudes)) for note in NOTES]
    return said if sizes == {full} else [REDUCED, *said]


def paper_table(sweeps: Sequence[tuple[str, Sweep]]) -> Table:
    """The paper's claims and figures beside each sweep's."""
    experiment = sweeps[0][1].experiment
    draw = experiment.reproduce.draws[0]
    rows = [
        [
            "training samples",
            f"4·15^4 = {_samples(GridSample())}",
            *(_samples(s.experiment.sample) for _, s in sweeps),
        ],
        ["test trajectories", _tests(BoxSample()), *(_tests(s.experiment.test) for _, s in sweeps)],
    ]
    best = " and ".join(map(str, BEST_ORDERS))
    for excitation in experiment.reproduce.excitations:
        for order in BEST_ORDERS:
            if order in experiment.reproduce.orders:
                label = f"RMSE, order {order}, {INPUTS[excitation]}"
                scores = [score_text(s.figures(draw, order, excitation), unit=" %") for _, s in sweeps]
                rows.append([label, f"{BEST_RMSE} %", *scores])
        found = [_best(s, draw, excitation) for _, s in sweeps]
        rows.append([f"best order, {INPUTS[excitation]}", best, *found])
    for kind, highest in (("random", 7), ("even", 10)):
        if kind in experiment.reproduce.draws:
            tried = max((order for order in experiment.reproduce.orders if order <= highest), default=0)
            label = f"yaw-rate error, {kind}, order ≤ {tried}"
            rows.append([label, "without error", *(_yaw(s, kind, highest) for _, s in sweeps)])
    return Table(f"Paper versus here ({draw} draw unless named)", ["", "paper", *(label for label, _ in sweeps)], rows)


def order_tables(sweeps: Sequence[tuple[str, Sweep]]) -> list[Table]:
    """For each draw, a row for each order: mean ± std (median) in percent for each kind of test inputs."""
    plan = sweeps[0][1].experiment.reproduce
    tables = []
    for draw in plan.draws:
        rows = []
        for order in plan.orders:
            for i, (label, sweep) in enumerate(sweeps):
                cells = [sweep.figures(draw, order, excitation) for excitation in plan.excitations]
                functions = next((str(cell["functions"]) for cell in cells if cell is not None), "–")
                name = f"{order} ({functions})" if i == 0 else f"  {label}"
                rows.append([name, *map(score_text, cells)])
        title = f"RMSE in %, mean ± std (median), with N functions, {draw} draw"
        tables.append(Table(title, ["order (N)", *(INPUTS[e] for e in plan.excitations)], rows))
    return tables


def full_table(sweeps: Sequence[tuple[str, Sweep]]) -> Table:
    """Every figure of every cell."""
    header = [
        "run",
        "draw",
        "seed",
        "order",
        "inputs",
        "mean",
        "std",
        "median",
        "max",
        "relift mean",
        "printed mean",
    ]
    header += ["max yaw error (rad/s)", "diverged", "artefact"]
    rows = []
    for label, sweep in sweeps:
        for scored in sweep.scored:
            cell, figures = scored.cell, scored.figures
            numbers = [figures["rmse"][statistic] for statistic in ("mean", "std", "median", "max")]
            numbers += [figures["rmse_relift"]["mean"], figures["rmse_printed"]["mean"]]
            numbers += [figures["max_error"]["yaw_rate"]]
            text = [f"{number:.4g}" for number in numbers]
            about = [label, cell.draw, str(cell.seed), str(cell.order), cell.excitation]
            rows.append([*about, *text, str(figures["diverged"]), scored.record.name])
    return Table("Every evaluation, RMSE in %", header, rows)


def score_text(figures: Meta | None, unit: str = "") -> str:
    """``mean ± std (median)`` of the RMSE to three digits."""
    if figures is None:
        return "–"
    rmse = figures["rmse"]
    return f"{rmse['mean']:.3g} ± {rmse['std']:.2g} ({rmse['median']:.3g}){unit}"


def _samples(sample: GridSample | BoxSample) -> str:
    return f"{sample.trajectories:,}".replace(",", " ")


def _tests(test: BoxSample) -> str:
    return f"{test.count:,} × {test.steps}".replace(",", " ")


def _best(sweep: Sweep, draw: str, excitation: str) -> str:
    found = {order: sweep.figures(draw, order, excitation) for order in sweep.experiment.reproduce.orders}
    means = {order: figures["rmse"]["mean"] for order, figures in found.items() if figures is not None}
    best = min(means, key=lambda order: means[order])
    return f"{best} ({means[best]:.3g} %)"


def _yaw(sweep: Sweep, draw: str, highest: int) -> str:
    error = sweep.yaw_error(draw, highest)
    return "–" if error is None else f"{error:.1e} rad/s"
