"""The verdict on a log as one page that needs nothing else: the sentence, pictures, and tables."""

from __future__ import annotations

from importlib.resources import files

from koopcli import __version__
from koopcli.config.experiment import load_experiment
from koopcli.koopman.selection.record import Selection
from koopcli.logs.imported import Log
from koopcli.reproduction.images import address
from koopcli.reproduction.markup import table, text
from koopcli.reproduction.report import Table
from koopcli.stages import figure_tasks
from koopcli.stages.base import Task
from koopcli.stages.pipeline import Pipeline

CAPTIONS = {
    "skill": "Error against time ahead on parts of the log that no fit saw, beside holding the state and DMDc.",
    "forecast": "Measured and predicted, from starts where the car moves; the predictor was fitted to the whole log.",
    "log": "The log: its signals, its gaps in grey, and what was flagged.",
}


def verdict_page(pipeline: Pipeline, log: Task, selection: Task, score: Task) -> str:
    """The page of a ``selection`` on a ``log``; ``score``: that of the chosen predictor there."""
    experiment = load_experiment("paper", {})
    made = pipeline.make(selection)
    pictures = []
    for name, task in (("skill", selection), ("forecast", score), ("log", log)):
        drawing = pipeline.make(figure_tasks.figure(name, [task], "svg", experiment)).content
        pictures.append(
            f'<figure><img src="{address(drawing)}" alt="{name}"><figcaption>{CAPTIONS[name]}</figcaption></figure>'
        )
    body = [
        f"<header><h1>Is it worth having?</h1><p>{text(made.content.verdict)}</p></header>",
        f'<main><section><div class="figures">{"".join(pictures)}</div>',
        *(f"<h3>{text(shown.title)}</h3>{table(shown)}" for shown in _tables(made.content, pipeline.make(log).content)),
        f"</section></main><footer><p>koop {__version__}, {text(made.record.name)}</p></footer>",
    ]
    css = files("koopcli.reproduction").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>Verdict</title><style>{css}</style></head><body>{''.join(body)}</body></html>\n"
    )


def _tables(selection: Selection, log: Log) -> list[Table]:
    figures = selection.figures()
    units = dict(zip(selection.state_channels.names, selection.state_channels.units, strict=True))
    errors = [
        [f"{state} ({units[state]})", f"{horizon} s", *(f"{about[key]:.3g}" for key in ("rmse", "to_hold", "to_dmdc"))]
        for state, horizons in figures["per_state"].items()
        for horizon, about in horizons.items()
    ]
    blocks = [
        [str(i + 1), block["picked"], f"{block['ratio_to_dmdc']:.2f}"] for i, block in enumerate(figures["blocks"])
    ]
    checks = [[check.name, check.signal, check.measured, check.healthy, check.verdict] for check in log.checks]
    return [
        Table("Errors on rows held out", ["state", "ahead", "RMSE", "× hold", "× DMDc"], errors, left=2),
        Table("Parts held out", ["part", "picked without it", "× DMDc"], blocks, left=2),
        Table("Checks of the log", ["check", "signal", "value", "healthy", "verdict"], checks, left=5),
    ]
