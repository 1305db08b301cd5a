"""The runs of all competitors as a Markdown table, ratios and notes."""

from __future__ import annotations

import math
import os
import re
import statistics
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

PACKAGES = ("pykoop", "deeptime", "deeptime, streamed", "PyKoopman", "datafold")  # what a ratio to "a package" is to
ROWS, FUNCTIONS = 202_500, 512


@dataclass
class Results:
    """``runs`` of each dataset and competitor, why a competitor ``failures``, and flop/s of ``dgemm``."""

    runs: dict[str, dict[str, list[dict[str, Any]]]]
    failures: dict[str, str]
    dgemm: float = float("nan")

    def median(self, dataset: str, competitor: str, figure: str) -> float:
        """Of all runs; not a number where there are none."""
        values = [run[figure] for run in self.runs[dataset].get(competitor, [])]
        return statistics.median(values) if values else float("nan")

    def pack(self) -> dict[str, Any]:
        """All of it as JSON."""
        return asdict(self) | {"hardware": hardware()}

    def share(self) -> float:
        """The 2 n N² of a cross product over koop's fit of unstructured samples, as a share of dgemm."""
        return 2 * ROWS * FUNCTIONS**2 / self.median("unstructured", "koop", "fit") / self.dgemm


def hardware() -> str:
    """The model and number of processors."""
    model = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text())
    return f"{model[1] if model else 'unknown processor'}, {os.cpu_count()} cores"


def table(results: Results) -> str:
    """A row for each dataset and competitor."""
    lines = [
        "| dataset | | fit: CPU s | with lifting | growth: MB | prediction: CPU s | error, 1 step: % | 30 steps: % |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for dataset, found in results.runs.items():
        for name, runs in found.items():
            if not runs or name in results.failures:
                lines.append(f"| {dataset} | {name} | {results.failures.get(name, 'not run')} | | | | | |")
                continue
            fit, lifting, growth, predict, one, many = (
                results.median(dataset, name, figure)
                for figure in ("fit", "fit_and_lifting", "growth", "predict", "error_one_step", "error_all_steps")
            )
            scaled = f" ({runs[0]['timed']} timed, scaled)" if runs[0]["scaled"] else ""
            whole = "inside" if name == "koop" else f"{lifting:.2f}"
            lines.append(
                f"| {dataset} | {name} | {fit:.2f} | {whole} | {growth:.0f} | {predict:.2f}{scaled} "
                f"| {one:.8f} | {many:.8f} |"
            )
    return "\n".join(lines)


def ratios(results: Results) -> str:
    """What koop is to be measured by, all from these runs."""
    lines = ["| koop and the packages | measured | aim |", "|---|---|---|"]

    def line(what: str, dataset: str, figure: str, ours: str, aim: str, among: Iterable[str] = PACKAGES) -> None:
        seen = {each: results.median(dataset, each, figure) for each in among}
        seen = {each: value for each, value in seen.items() if not math.isnan(value) and each not in results.failures}
        if not seen:
            return
        best = min(seen, key=seen.__getitem__)
        mine, theirs = results.median(dataset, "koop", ours), seen[best]
        places = 0 if figure == "growth" else 2
        both = f"{mine:.{places}f}, {best} {theirs:.{places}f}"
        lines.append(f"| {dataset}: {what} | {both}: 1 / {theirs / mine:.1f} | {aim} |")

    line("fit, lifting not counted for the package, CPU s", "product", "fit", "fit", "≤ 1/10")
    line("fit with lifting, CPU s", "product", "fit_and_lifting", "fit", "≤ 1/10")
    for each in PACKAGES:
        line("growth, MB", "product", "growth", "growth", "≤ 1/20", [each])
    line("fit, lifting not counted for the package, CPU s", "unstructured", "fit", "fit", "≤ 1/1.5")
    line("fit with lifting, CPU s", "unstructured", "fit_and_lifting", "fit", "≤ 1/1.5")
    for dataset in results.runs:
        line("prediction of 3 375 × 30, CPU s", dataset, "predict", "predict", "≤ 1/20")
    lines.append(
        f"| unstructured: 2 n N² / fit as a share of dgemm's {results.dgemm / 1e9:.1f} GFlop/s per CPU second "
        f"| {100 * results.share():.0f} % | ≥ 60 % |"
    )
    return "\n".join(lines)


def notes(results: Results) -> str:
    """How each competitor did it, and with what."""
    lines = []
    for name in next(iter(results.runs.values())):
        runs = [run for found in results.runs.values() for run in found[name]]
        if runs:
            versions = ", ".join(f"{package} {version}" for package, version in runs[0]["versions"].items())
            lines.append(f"* {name}: {runs[0]['how']} ({versions}).")
    return "\n".join(lines)
