"""The paper's claims about EDMD, each with what was found here, a verdict from it, and the command that shows it."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.config.sampled import INPUTS, Excitation
from koopcli.config.settings import FitEdmd
from koopcli.records import Meta
from koopcli.reproduction import edmd_cells as blocks
from koopcli.reproduction.edmd_cells import Training
from koopcli.reproduction.report import Run, Table, number_text

CLEAR = 1.02  # a ratio of two mean errors from which one is called larger
WORSE = 1.05  # the same, from the best order to the largest basis
YAW_EXACT = {"even": 1e-9, "chebyshev": 1e-9, "random": 1e-6}  # rad/s: what rounding leaves, by training draw
FORCED: tuple[Excitation, ...] = ("none", "fresh")  # inputs that training forces of one size are judged by
YAW_ORDERS = {"even": 10, "chebyshev": 10, "random": 7}


@dataclass(frozen=True)
class Finding:
    """What was found of a claim, line by line, and what follows."""

    here: Sequence[str]
    verdict: str


@dataclass(frozen=True)
class Claim:
    """A claim of the paper: ``found`` judges it by a run, ``shows`` is the command that shows it."""

    text: str
    paper: str
    found: Callable[[Run], Finding | None]
    shows: Callable[[Run], Command]


@dataclass(frozen=True)
class Command:
    """A command: its ``words``, what it ``sets``, and the beginnings of those changes of a run that it ``keeps``."""

    words: tuple[str, ...]
    sets: Mapping[str, object]
    keeps: tuple[str, ...]

    def text(self, run: Run) -> str:
        """As it is typed, for the experiment of ``run``."""
        told = [] if run.base == "paper" else ["--experiment", run.base]
        for name, value in self.sets.items():
            told += ["--set", f"{name}={value}"]
        for change in run.changes:
            name = change.partition("=")[0]
            if name not in self.sets and f"{name}.".startswith(self.keeps):
                told += ["--set", change]
        return shlex.join(["koop", *self.words, *told])


def claims_table(run: Run) -> Table:
    """Claim, paper, here, verdict and command."""
    rows = []
    for claim in CLAIMS:
        finding = claim.found(run)
        if finding is not None:
            rows.append([claim.text, claim.paper, "\n".join(finding.here), finding.verdict, claim.shows(run).text(run)])
    title = "The paper's claims" if run.label == "here" else f"The paper's claims, with {run.label}"
    return Table(title, ["claim", "paper", "here", "verdict", "command"], rows, words=True)


def mean(figures: Meta) -> float:
    """The mean error in percent; infinite where predictions diverged, which leaves them out of it."""
    value = float(figures["rmse"]["mean"])
    return math.inf if figures["diverged"] or math.isnan(value) else value


def _figures(run: Run, training: Training, fit: FitEdmd, kind: Excitation | None = None) -> Meta:
    """The numbers of a fit of a training grid, under the inputs that claims are judged by unless others are said."""
    kind = kind or blocks.excitation(run.experiment)
    return run.figures(blocks.evaluated(run.experiment, training, fit, kind))


def by_order(run: Run, training: Training, kind: Excitation | None = None) -> dict[int, float]:
    """The mean error of every order on a training grid."""
    fits = {order: blocks.polynomials(run.experiment, order) for order in run.experiment.reproduce.orders}
    return {order: mean(_figures(run, training, fit, kind)) for order, fit in fits.items()}


def _smallest(means: Mapping[int, float]) -> int:
    return min(means, key=lambda order: means[order])


def _percent(value: float) -> str:
    return f"{number_text(value)} %" if math.isfinite(value) else "diverges"


def _floor(run: Run) -> Finding:
    """The best linear predictor, and the bilinear ones, on the first training draw."""
    experiment, training, said = run.experiment, blocks.trainings(run.experiment)[0], list[str]()
    best: dict[str, float] = {}
    for kind in experiment.reproduce.excitations:
        linear = by_order(run, training, kind)
        order = _smallest(linear)
        text = f"{INPUTS[kind]}: {_percent(linear[order])} (order {order})"
        for fit in blocks.bilinears(experiment):
            figures = _figures(run, training, fit, kind)
            text += f", {fit.terms} {_percent(mean(figures))}"
            best[kind] = min(mean(figures), best.get(kind, math.inf))
        said.append(text)
    worst = max(best.values())
    if not worst < BEST_RMSE:
        return Finding(said, "holds")
    ratio = f"{BEST_RMSE / worst:.0f} times better with {figures['functions']} functions"
    return Finding(said, f"does not hold: bilinear terms are {ratio}, where a constant B has a floor")


def _splines(run: Run) -> Finding:
    """Polynomials of the paper's best order beside splines, wherever both were fitted."""
    experiment, order, said, holds = run.experiment, blocks.best_order(run.experiment), [], []
    fits = (blocks.polynomials(experiment), blocks.splines(experiment))
    for training in blocks.compared_on(experiment):
        polynomial, spline = (mean(_figures(run, training, fit)) for fit in fits)
        said.append(f"{training.name}: {_percent(polynomial)} (order {order}), splines {_percent(spline)}")
        holds.append(polynomial < spline)
    return Finding(said, _verdict(holds))


def _best(run: Run) -> Finding | None:
    """The order of the smallest mean on every training draw, and over many where they were tried."""
    if not set(BEST_ORDERS) & set(run.experiment.reproduce.orders):
        return None
    here, near, holds = [], [], []
    for training in blocks.trainings(run.experiment):
        means = by_order(run, training)
        order = _smallest(means)
        here.append(f"{training.name}: {order} ({_percent(means[order])})")
        near.append(min((means[o] for o in BEST_ORDERS if o in means), default=math.inf) <= CLEAR * means[order])
        holds.append(order in BEST_ORDERS)
    verdict = f"{_verdict(holds)}; within 2 % of the best in {sum(near)} of {len(near)}"
    counts = Counter(_smallest(by_order(run, training)) for training in blocks.more_trainings(run.experiment))
    if counts:
        total = counts.total()
        here.append(f"over {total} random draws: {', '.join(f'{one} in {counts[one]}' for one in sorted(counts))}")
        verdict += f"; 6 to 8 in {sum(counts[order] for order in (6, 7, 8))} of {total}"
    return Finding(here, verdict)


def _larger(run: Run) -> Finding | None:
    """The largest basis over the best, and the textbook's regression beside it."""
    if max(run.experiment.reproduce.orders) <= BEST_ORDERS[-1]:
        return None
    everywhere, said, worse = blocks.trainings(run.experiment), [], []
    for training in everywhere:
        means = by_order(run, training)
        best, last = min(means.values()), max(means)
        said.append(f"{training.name}: {_percent(means[last])} (order {last}), best {_percent(best)}")
        worse.append(means[last] > WORSE * best)
    text, first = _verdict(worse), everywhere[0]
    textbook = {order: mean(_figures(run, first, fit)) for order, fit in blocks.textbook(run.experiment).items()}
    if textbook:
        listed = ", ".join(f"{_percent(value)} (order {order})" for order, value in textbook.items())
        said.append(f"by normal equations of monomials, {first.name}: {listed}")
        if max(textbook.values()) > WORSE * min(textbook.values()):
            text += ", by extrapolation" if any(worse) else ""
            text += "; with the textbook's normal equations it does, by rounding"
    return Finding(said, text)


def _forces(run: Run) -> Finding | None:
    """The best order trained with forces of one size, by which linear predictors are judged."""
    plan, first, best = (
        run.experiment.reproduce,
        blocks.trainings(run.experiment)[0],
        blocks.polynomials(run.experiment),
    )
    if len(plan.training_forces) < 2 or best.terms != "linear":
        return None
    said, holds = [], []
    for kind in [kind for kind in FORCED if kind in plan.excitations]:
        means = [mean(_figures(run, replace(first, force=force), best, kind)) for force in plan.training_forces]
        both = zip(plan.training_forces, means, strict=True)
        said.append(f"{INPUTS[kind]}: {', '.join(f'±{force:g} N {_percent(value)}' for force, value in both)}")
        holds.append(means[-1] > CLEAR * means[0])
    return Finding(said, _verdict(holds)) if said else None


def _yaw(run: Run) -> Finding | None:
    """The largest yaw-rate error up to the order to which rounding is harmless, of each kind of draw."""
    plan, said, holds = run.experiment.reproduce, [], []
    for training in blocks.trainings(run.experiment):
        orders = [order for order in plan.orders if order <= YAW_ORDERS[training.draw]]
        if not orders:
            continue
        fits = [blocks.polynomials(run.experiment, order) for order in orders]
        scores = [_figures(run, training, fit, kind) for fit, kind in product(fits, plan.excitations)]
        error = max(figures["max_error"]["yaw_rate"] for figures in scores)
        said.append(f"{training.name}: {error:.1e} rad/s up to order {max(orders)}")
        holds.append(error <= YAW_EXACT[training.draw])
    return Finding(said, _verdict(holds, "holds, to rounding")) if said else None


def _verdict(holds: Sequence[bool], yes: str = "holds") -> str:
    if all(holds):
        return yes
    return f"holds in {sum(holds)} of {len(holds)} cases" if any(holds) else "does not hold"


DATA = ("vehicle.", "sample.", "simulate.")
SWEPT = tuple(f"fit-edmd.{name}." for name in ("basis", "degree_velocity", "terms", "ridge", "solver"))
SPLINED = tuple(f"fit-edmd.{name}." for name in ("centres", "placement", "seed"))


def _evaluate(run: Run, keeps: tuple[str, ...] = (), **fit: object) -> Command:
    """The evaluation of a fit on the first training grid, under the inputs that claims are judged by."""
    sets = {f"fit-edmd.{name}": value for name, value in fit.items()}
    return Command(("evaluate",), {**sets, **_first_grid(run), **_test(run)}, (*DATA, "test.", "evaluate.", *keeps))


def _first_grid(run: Run) -> dict[str, object]:
    """What the first training grid differs in from the experiment's own."""
    first, own = blocks.trainings(run.experiment)[0], blocks.grid(run.experiment)
    sets: dict[str, object] = {} if first.draw == own.draw else {"sample.draw": first.draw}
    return sets if first.seed == own.seed else {**sets, "sample.seed": first.seed}


def _test(run: Run) -> dict[str, object]:
    excitation = blocks.excitation(run.experiment)
    return {} if excitation == blocks.box(run.experiment).excitation else {"test.excitation": excitation}


def _show_floor(run: Run) -> Command:
    fit = blocks.bilinear(run.experiment, "generator")
    return _evaluate(run, basis=fit.basis, order=fit.order, terms=fit.terms)


def _show_orders(run: Run) -> Command:
    keeps = (*DATA, "test.", "evaluate.", "reproduce.orders.", *SWEPT)
    return Command(("plot", "orders"), {**_first_grid(run), **_test(run)}, keeps)


def _show_forces(run: Run) -> Command:
    sample, order = blocks.grid(run.experiment), blocks.best_order(run.experiment)
    shown = _evaluate(run, SWEPT, order=order)
    largest = f"[{run.experiment.reproduce.training_forces[-1]:g}]"
    columns = len(sample.levels) * sample.columns
    return Command(shown.words, {**shown.sets, "sample.levels": largest, "sample.columns": columns}, shown.keeps)


def _show_yaw(run: Run) -> Command:
    sets = {"fit-edmd.order": blocks.best_order(run.experiment), **_first_grid(run)}
    return Command(("plot", "random-input"), sets, (*DATA, "test.point.", "plot.", *SWEPT))


CLAIMS = (
    Claim("an error of 11.1 % is the best there is", f"{BEST_RMSE} %, test inputs not stated", _floor, _show_floor),
    Claim(
        "polynomials beat thin-plate splines",
        "said, without a figure",
        _splines,
        lambda run: _evaluate(run, SPLINED, basis=blocks.SPLINES),
    ),
    Claim("orders 6 and 7 are best", "6 and 7", _best, _show_orders),
    Claim(
        "larger bases get worse",
        "grows exponentially",
        _larger,
        lambda run: _evaluate(run, order=blocks.TEXTBOOK_ORDERS[-1], solver="cholesky-monomials"),
    ),
    Claim("small training forces beat large ones", "±1 to ±100 N chosen", _forces, _show_forces),
    Claim("the yaw rate is tracked without error", "without error", _yaw, _show_yaw),
)
