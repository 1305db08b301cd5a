"""The paper's claims about EDMD, each with what was found here, a verdict from it, and the command that shows it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from koopcli.config.paper import BEST_ORDERS, BEST_RMSE
from koopcli.koopman.edmd.fit import FitEdmd
from koopcli.records import Meta
from koopcli.reproduction import commands
from koopcli.reproduction.commands import ClaimCommand
from koopcli.reproduction.edmd_cells import Edmd, Training
from koopcli.reproduction.report import Run, Table
from koopcli.reproduction.texts import number_text
from koopcli.simulation.samples.sample import INPUTS, Excitation

CLEAR = 1.02  # a ratio of two mean errors from which one is called larger
WORSE = 1.05  # the same, from the best order to the largest basis
YAW_EXACT = {"even": 1e-9, "chebyshev": 1e-9, "random": 1e-6}  # rad/s: what rounding leaves, by training draw
FORCED: tuple[Excitation, ...] = ("none", "fresh")  # inputs that training forces of one size are judged by
YAW_ORDERS = {"even": 10, "chebyshev": 10, "random": 7}


@dataclass(frozen=True)
class Judgement:
    """What was found of a claim, line by line, and what follows."""

    here: Sequence[str]
    verdict: str


@dataclass(frozen=True)
class Claim:
    """A claim of the paper: ``judged`` is what a run says of it, ``shows`` is the command that shows it."""

    text: str
    paper: str
    judged: Callable[[Run], Judgement | None]
    shows: Callable[[Run], ClaimCommand]


def claims_table(run: Run) -> Table:
    """Claim, paper, here, verdict and command."""
    rows = []
    for claim in CLAIMS:
        finding = claim.judged(run)
        if finding is not None:
            rows.append([claim.text, claim.paper, "\n".join(finding.here), finding.verdict, claim.shows(run).text(run)])
    title = "The paper's claims" if run.label == "here" else f"The paper's claims, with {run.label}"
    return Table(title, ["claim", "paper", "here", "verdict", "command"], rows, words=True)


def mean(figures: Meta) -> float:
    """The mean error in percent; infinite where predictions diverged, which leaves them out of it."""
    value = float(figures["rmse"]["mean"])
    return math.inf if figures["diverged"] or math.isnan(value) else value


def means(
    run: Run, training: Training, fits: Mapping[int, FitEdmd], kind: Excitation | None = None
) -> dict[int, float]:
    """The mean errors of fits of several orders, under the inputs that claims are judged by unless others are said."""
    tasks = {order: Edmd(run.experiment).evaluated(training, fit, kind) for order, fit in fits.items()}
    return {order: mean(run.figures(task)) for order, task in tasks.items()}


def _smallest(means: Mapping[int, float]) -> int:
    return min(means, key=lambda order: means[order])


def _percent(value: float) -> str:
    return f"{number_text(value)} %" if math.isfinite(value) else "diverges"


def _floor(run: Run) -> Judgement:
    """The best linear predictor, and the bilinear ones, on the first training draw."""
    edmd, lines = Edmd(run.experiment), list[str]()
    best: dict[str, float] = {}
    for kind in run.experiment.reproduce.excitations:
        linear = means(run, edmd.first, edmd.polynomials, kind)
        order = _smallest(linear)
        text = f"{INPUTS[kind]}: {_percent(linear[order])} (order {order})"
        for fit in (edmd.bilinear, edmd.generator):
            figures = run.figures(edmd.evaluated(edmd.first, fit, kind))
            text += f", {fit.terms.kind} {_percent(mean(figures))}"
            best[kind] = min(mean(figures), best.get(kind, math.inf))
        lines.append(text)
    worst = max(best.values())
    if not worst < BEST_RMSE:
        return Judgement(lines, "holds")
    ratio = f"{BEST_RMSE / worst:.0f} times better with {figures['functions']} functions"
    return Judgement(lines, f"does not hold: bilinear terms are {ratio}, where a constant B has a floor")


def _splines(run: Run) -> Judgement:
    """Polynomials of the paper's best order beside splines, wherever both were fitted."""
    edmd, lines, holds = Edmd(run.experiment), [], []
    for training in edmd.both:
        polynomial, spline = (mean(run.figures(edmd.evaluated(training, fit))) for fit in (edmd.best, edmd.splines))
        lines.append(f"{training.name}: {_percent(polynomial)} (order {edmd.order}), splines {_percent(spline)}")
        holds.append(polynomial < spline)
    return Judgement(lines, _verdict(holds))


def _best(run: Run) -> Judgement | None:
    """The order of the smallest mean on every training draw, and over many where they were tried."""
    edmd = Edmd(run.experiment)
    if not set(BEST_ORDERS) & set(edmd.polynomials):
        return None
    here, near, holds = [], [], []
    for training in edmd.trainings:
        errors = means(run, training, edmd.polynomials)
        order = _smallest(errors)
        here.append(f"{training.name}: {order} ({_percent(errors[order])})")
        near.append(min((errors[o] for o in BEST_ORDERS if o in errors), default=math.inf) <= CLEAR * errors[order])
        holds.append(order in BEST_ORDERS)
    verdict = f"{_verdict(holds)}; within 2 % of the best in {sum(near)} of {len(near)}"
    counts = Counter(_smallest(means(run, training, edmd.polynomials)) for training in edmd.many)
    if counts:
        total = counts.total()
        here.append(f"over {total} random draws: {', '.join(f'{order} in {n}' for order, n in sorted(counts.items()))}")
        verdict += f"; 6 to 8 in {sum(counts[order] for order in (6, 7, 8))} of {total}"
    return Judgement(here, verdict)


def _larger(run: Run) -> Judgement | None:
    """The largest basis over the best, and the textbook's regression beside it."""
    edmd = Edmd(run.experiment)
    if max(edmd.polynomials) <= BEST_ORDERS[-1]:
        return None
    lines, worse = [], []
    for training in edmd.trainings:
        errors = means(run, training, edmd.polynomials)
        best, last = min(errors.values()), max(errors)
        lines.append(f"{training.name}: {_percent(errors[last])} (order {last}), best {_percent(best)}")
        worse.append(errors[last] > WORSE * best)
    text, textbook = _verdict(worse), means(run, edmd.first, edmd.textbook)
    if textbook:
        listed = ", ".join(f"{_percent(value)} (order {order})" for order, value in textbook.items())
        lines.append(f"by normal equations of monomials, {edmd.first.name}: {listed}")
        if max(textbook.values()) > WORSE * min(textbook.values()):
            text += ", by extrapolation" if any(worse) else ""
            text += "; with the textbook's normal equations it does, by rounding"
    return Judgement(lines, text)


def _forces(run: Run) -> Judgement | None:
    """The best order trained with forces of one size, by which linear predictors are judged."""
    edmd, plan = Edmd(run.experiment), run.experiment.reproduce
    if len(plan.training_forces) < 2 or edmd.best.terms.kind != "linear":
        return None
    lines, holds = [], []
    for kind in [kind for kind in FORCED if kind in plan.excitations]:
        trainings = {force: replace(edmd.first, force=force) for force in plan.training_forces}
        errors = {f: mean(run.figures(edmd.evaluated(each, edmd.best, kind))) for f, each in trainings.items()}
        lines.append(f"{INPUTS[kind]}: {', '.join(f'±{f:g} N {_percent(value)}' for f, value in errors.items())}")
        smallest, *_, largest = errors.values()
        holds.append(largest > CLEAR * smallest)
    return Judgement(lines, _verdict(holds)) if lines else None


def _yaw(run: Run) -> Judgement | None:
    """The largest yaw-rate error up to the order to which rounding is harmless, of each kind of draw."""
    edmd, lines, holds = Edmd(run.experiment), [], []
    for training in edmd.trainings:
        fits = {order: fit for order, fit in edmd.polynomials.items() if order <= YAW_ORDERS[training.draw]}
        if not fits:
            continue
        both = product(fits.values(), run.experiment.reproduce.excitations)
        tasks = [edmd.evaluated(training, fit, kind) for fit, kind in both]
        error = max(run.figures(task)["max_error"]["yaw_rate"] for task in tasks)
        lines.append(f"{training.name}: {error:.1e} rad/s up to order {max(fits)}")
        holds.append(error <= YAW_EXACT[training.draw])
    return Judgement(lines, _verdict(holds, "holds, to rounding")) if lines else None


def _verdict(holds: Sequence[bool], yes: str = "holds") -> str:
    if all(holds):
        return yes
    return f"holds in {sum(holds)} of {len(holds)} cases" if any(holds) else "does not hold"


CLAIMS = (
    Claim("an error of 11.1 % is the best there is", f"{BEST_RMSE} %, test inputs not stated", _floor, commands.best),
    Claim("polynomials beat thin-plate splines", "said, without a figure", _splines, commands.splines),
    Claim("orders 6 and 7 are best", "6 and 7", _best, commands.orders),
    Claim("larger bases get worse", "grows exponentially", _larger, commands.textbook),
    Claim("small training forces beat large ones", "±1 to ±100 N chosen", _forces, commands.forces),
    Claim("the yaw rate is tracked without error", "without error", _yaw, commands.yaw),
)
