"""The command that scores, with what the scores are worth."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopcli.cli import fitting
from koopcli.cli.completion import complete_name
from koopcli.cli.invocation import Invocation, begin
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    WorkersOption,
    names,
)
from koopcli.config.changes import Changes, Values
from koopcli.config.driving import DriveSample
from koopcli.config.sampled import Excitation
from koopcli.config.samples import BallSample, BoxSample
from koopcli.console import Console, show_table

if TYPE_CHECKING:
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact


TEST = ("test", "evaluate")


def evaluate(
    predictor: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_name, help="A predictor; fit-edmd makes one when left out."),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(autocompletion=complete_name, metavar="TRAJECTORIES", help="Test on these trajectories."),
    ] = None,
    excitation: Annotated[
        Excitation | None,
        typer.Option(
            metavar=names(Excitation),
            help=f"Inputs of the test set (forces: {BoxSample.excitation}, wheels: {DriveSample.excitation}).",
        ),
    ] = None,
    amplitude: Annotated[
        float | None, typer.Option(help=f"forces: test inputs within ± amplitude, in N ({BoxSample.amplitude:g}).")
    ] = None,
    count: Annotated[
        int | None,
        typer.Option(help=f"Test trajectories ({BoxSample.count}; slips: {BallSample.count})."),
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(
            help=f"Steps of each (forces: {BoxSample.steps}, slips: {BallSample.steps}, wheels: {DriveSample.steps})."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help=f"Seed of the test set ({BoxSample.seed}; slips: {BallSample.seed})."),
    ] = None,
    restart: Annotated[
        int | None,
        typer.Option(
            help="Start the prediction afresh from the true state every so many steps, and score each stretch. Of a "
            "predictor driven by forces the test set is then the paper's trajectory under random inputs (kind point)."
        ),
    ] = None,
    workers: WorkersOption = 1,
    cluster: ClusterOption = None,
    set_: SetOption = None,
    experiment: ExperimentOption = "paper",
    store: StoreOption = None,
    dry_run: DryRunOption = False,
    as_json: JsonOption = False,
) -> None:
    """Score a predictor on test trajectories of its own plant and vehicle: RMSE, re-lifted RMSE, largest errors.

    The plant names the test set: a box of states with inputs for forces, the states inside Γ without inputs for slips,
    cars under way with torques and steer for wheels.
    An interrupted evaluation goes on where it stopped. Beside it stand what fits nothing, the first state held and the
    plant linearised there, and the linear predictor of the same data, with a verdict.

    Example: koop evaluate fit-edmd/3f2a --excitation held
    """
    given: Values = {"excitation": excitation, "amplitude": amplitude, "count": count, "steps": steps, "seed": seed}
    changes: Changes = {"test": given, "evaluate": {"restart": restart}}
    call = begin(store, experiment, set_, (*fitting.DATA, "fit-edmd", *TEST), changes, workers, cluster)
    from koopcli.stages import recipes
    from koopcli.stages.verdict import beside

    of = call.optional(predictor, recipes.FITS, "the PREDICTOR", TEST)
    elsewhere = [section for section in call.changes if section != "test"]
    test = call.optional(on, ["simulate"], "--on", elsewhere)
    if of is not None and test is None:
        test = recipes.test_set(call.experiment, call.simulated(of))
    task = recipes.evaluation(call.experiment, of, test)
    others = beside(call.experiment, task)
    call.run(
        task,
        as_json=as_json,
        dry_run=dry_run,
        extra=lambda artefact: _judge(call, artefact, others),
        also=list(others.values()),
    )


def _judge(call: Invocation, artefact: Artefact, others: dict[str, Task]) -> dict[str, Any]:
    """The scores of the ``others`` beside those of ``artefact``, with the verdict, as a table and as JSON."""
    from koopcli.stages.pipeline import Pipeline
    from koopcli.stages.verdict import NAMES, fitted_to_test_data, verdict

    about = {"fitted_to_test_data": fitted_to_test_data(artefact.record, call.pipeline.store)}
    if about["fitted_to_test_data"]:
        call.console.warn(
            "the predictor was fitted to these test trajectories, so its scores say how well it fits, not how well it "
            "predicts: test it on others, such as those of another seed"
        )
    if not others:
        call.console.note("no baselines beside it: the data that this predictor was fitted to are no longer there")
        return about
    quiet = Pipeline(call.pipeline.store, _Unwarned(call.console), call.pipeline.workers)
    names, figures = {}, {}
    for name, task in others.items():
        one = quiet.make(task)
        names[name], figures[name] = one.record.name, one.figures
        del one  # its scores may be many
    rows = [["this predictor", *_scores(artefact.figures)]]
    rows += [[NAMES[name], *_scores(found)] for name, found in figures.items()]
    show_table(["RMSE in %", "mean ± std", "median", "max", "re-lifted", "in the data's box"], rows, file=sys.stderr)
    for segment in artefact.figures.get("segments", []):
        call.console.note(f"from sample {segment['start']:>4}: RMSE {segment['rmse']:.4g} %")
    found = verdict(artefact.figures, figures)
    (call.console.note if found.beats else call.console.warn)(found.text)
    scores = {name: {"name": names[name], "rmse": figures[name]["rmse"]} for name in others}
    return {**about, "baselines": scores, "beats_baselines": found.beats, "verdict": found.text}


def _scores(figures: dict[str, Any]) -> list[str]:
    rmse = figures["rmse"]
    others = [rmse["median"], rmse["max"], figures["rmse_relift"]["mean"], figures["rmse_in_domain"]["mean"]]
    return [
        f"{rmse['mean']:.4g} ± {rmse['std']:.3g}",
        *("–" if math.isnan(value) else f"{value:.4g}" for value in others),
    ]


class _Unwarned:
    """A console that keeps to itself what is wrong with a baseline, which is meant to be poor."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self.note, self.progress = console.note, console.progress

    def warn(self, text: str) -> None:
        """Nothing."""


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("evaluate", rich_help_panel="Make")(evaluate)
