"""The commands that show what the paper's claims about EDMD are judged by."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace

from koopcli.choices import written
from koopcli.reproduction.edmd_cells import SPLINES, TEXTBOOK_ORDERS, Edmd
from koopcli.reproduction.report import Run

DATA = ("vehicle.", "sample.", "simulate.")
SWEPT = tuple(f"fit-edmd.{name}" for name in ("basis", "degree_velocity", "terms", "ridge", "solver"))
SPLINED = (f"fit-edmd.basis.{SPLINES}.",)


@dataclass(frozen=True)
class ClaimCommand:
    """A command: its ``words``, what it ``sets``, and the changes of a run that it ``keeps``, by name or by a
    beginning that ends in a dot.
    """

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
            kept = name in self.keeps or name.startswith(tuple(start for start in self.keeps if start.endswith(".")))
            if name not in self.sets and kept:
                told += ["--set", change]
        return shlex.join(["koop", *self.words, *told])


def _evaluate(run: Run, keeps: tuple[str, ...] = (), **fit: object) -> ClaimCommand:
    """The evaluation of a fit on the first training grid, under the inputs that claims are judged by."""
    sets = {f"fit-edmd.{name}": value for name, value in fit.items()}
    return ClaimCommand(
        ("evaluate",), {**sets, **_first_grid(run), **_test(run)}, (*DATA, "test.", "evaluate.", *keeps)
    )


def _first_grid(run: Run) -> dict[str, object]:
    """What the first training grid differs in from the experiment's own."""
    edmd = Edmd(run.experiment)
    names = [name for name in ("draw", "seed") if getattr(edmd.first, name) != getattr(edmd.grid, name)]
    return {f"sample.{name}": getattr(edmd.first, name) for name in names}


def _test(run: Run) -> dict[str, object]:
    edmd = Edmd(run.experiment)
    return {} if edmd.inputs == edmd.box.excitation else {"test.excitation": edmd.inputs}


def best(run: Run) -> ClaimCommand:
    """The evaluation of the best predictor with few functions."""
    fit = Edmd(run.experiment).generator
    return _evaluate(run, basis=fit.basis.kind, order=written(fit)["order"], terms=fit.terms.kind)


def splines(run: Run) -> ClaimCommand:
    """The evaluation of splines."""
    return _evaluate(run, SPLINED, basis=SPLINES)


def textbook(run: Run) -> ClaimCommand:
    """The evaluation of the largest basis by normal equations."""
    return _evaluate(run, order=TEXTBOOK_ORDERS[-1], solver="cholesky-monomials")


def orders(run: Run) -> ClaimCommand:
    """The figure of errors against the order."""
    keeps = (*DATA, "test.", "evaluate.", "reproduce.orders", *SWEPT)
    return ClaimCommand(("plot", "orders"), {**_first_grid(run), **_test(run)}, keeps)


def forces(run: Run) -> ClaimCommand:
    """The evaluation of the best order trained with the largest forces."""
    edmd, largest = Edmd(run.experiment), run.experiment.reproduce.training_forces[-1]
    shown, sample = _evaluate(run, SWEPT, order=edmd.order), replace(edmd.first, force=largest).of(edmd.grid)
    sets = {**shown.sets, "sample.levels": f"[{largest:g}]", "sample.columns": sample.columns}
    return replace(shown, sets=sets)


def yaw(run: Run) -> ClaimCommand:
    """The figure of a trajectory under random inputs."""
    sets = {"fit-edmd.order": Edmd(run.experiment).order, **_first_grid(run)}
    return ClaimCommand(("plot", "random-input"), sets, (*DATA, "test.point.", "plot.", *SWEPT))
