"""The command that scores, with what the scores are worth."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from koopcli.cli.advising import TEST, Typed, advice
from koopcli.cli.completion import complete_name
from koopcli.cli.derived import options_of
from koopcli.cli.invocation import DATA, Invocation, begin
from koopcli.cli.options import (
    ClusterOption,
    DryRunOption,
    ExperimentOption,
    JsonOption,
    SetOption,
    StoreOption,
    VehicleOption,
    WorkersOption,
)
from koopcli.config.changes import Changes, Values
from koopcli.config.declared import KINDS
from koopcli.config.experiment import Experiment
from koopcli.config.settings import Evaluate
from koopcli.console import Console, show_table
from koopcli.errors import UsageError

if TYPE_CHECKING:
    from koopcli.stages.base import Task
    from koopcli.stages.pipeline import Artefact

FITS = ("experiment", "fit-edmd", "fit-eigen")  # the sections that choose and make a predictor
OF_SCORES = ("restart", "input_matrix", "every")  # settings of evaluate, the others are of test samples
ASKED = ("excitation", "amplitude", "grip_share", "hold", "count", "steps", "seed", *OF_SCORES)


@options_of(*KINDS["test"].values(), Evaluate, only=ASKED)
def evaluate(
    context: typer.Context,
    predictor: Annotated[
        str | None,
        typer.Argument(
            autocompletion=complete_name,
            help="A predictor; made when left out, by the fit that the experiment is about or else fit-edmd.",
        ),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(autocompletion=complete_name, metavar="TRAJECTORIES", help="Test on these trajectories."),
    ] = None,
    *,
    given: Values,
    vehicle: VehicleOption = None,
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
    cars under way with torques and steer for wheels. A predictor of slips with force inputs (fit-eigen --inputs forces)
    is tested from the states inside Γ under changes of axle forces, and may be asked with another --input-matrix than
    it was fitted with.
    An interrupted evaluation goes on where it stopped. The predictor is compared with three baselines: the first state
    held, the plant linearised there, and a linear model of the same data. Where one of them is better, the last line
    says why and what to type.

    Example: koop evaluate --experiment best-edmd --vehicle bmw-320i
    """
    scored = {name: given.pop(name) for name in OF_SCORES if name in given}
    changes: Changes = {"test": given, "evaluate": scored, "vehicle": {"name": vehicle}}
    call = begin(store, experiment, set_, (*DATA, *FITS, *TEST), changes, workers, cluster)
    from koopcli.stages import fits, recipes
    from koopcli.stages.asked import tested_on
    from koopcli.stages.verdict import beside

    of = call.optional(predictor, tuple(fits.FITS), "the PREDICTOR", TEST)
    elsewhere = [section for section in call.changes if section != "test"]
    test = call.optional(on, ["simulate", "import"], "--on", elsewhere)
    log = test if test is not None else None if of is None else of.find("import")
    if log is not None and log.stage == "import":
        if of is None:
            raise UsageError("name the predictor to score on this log: koop evaluate PREDICTOR --on import/…")
        from koopcli.stages.measured import scored as on_log

        task = on_log(of, log)
        call.run(
            lambda experiment: task,
            as_json=as_json,
            dry_run=dry_run,
            extra=lambda artefact: _show_states(call.console, artefact),
        )
        return

    def evaluation(experiment: Experiment) -> Task:
        on = (
            recipes.test_set(experiment, tested_on(of, call.simulated(of))) if of is not None and test is None else test
        )
        return recipes.evaluation(experiment, of, on)

    task = evaluation(call.experiment)
    others = beside(call.experiment, task)
    typed = Typed.of(context)
    call.run(
        evaluation,
        as_json=as_json,
        dry_run=dry_run,
        extra=lambda artefact: _judge(call, typed, task, artefact, others),
        also=list(others.values()),
    )


def _show_states(console: Console, artefact: Artefact) -> None:
    """The errors of every state, beside hold and DMD with control, on stderr."""
    if artefact.content.own:
        console.warn(
            "the predictor was fitted to this log, so these errors flatter it: those on rows that no fit saw are told "
            "by koop select"
        )
    channels, figures = artefact.content.state_channels, artefact.figures
    outside, limited = (100 * figures[name] for name in ("outside_share", "limited_share"))
    console.note(
        f"{outside:.1f} % of the starts lie outside the states of training, {limited:.1f} % of the inputs are limited "
        "to theirs"
    )
    rows = [
        [name, unit, f"{horizon} s", f"{about['rmse']:.3g}", f"{about['to_hold']:.2f}", f"{about['to_dmdc']:.2f}"]
        for name, unit in zip(channels.names, channels.units, strict=True)
        for horizon, about in figures["per_state"][name].items()
    ]
    show_table(["state", "unit", "ahead", "RMSE", "× hold", "× DMDc"], rows, left=2, file=sys.stderr)


def _judge(call: Invocation, typed: Typed, task: Task, artefact: Artefact, others: dict[str, Task]) -> dict[str, Any]:
    """The scores of the ``others`` beside those of ``artefact``, with verdict and advice, as a table and as JSON."""
    from koopcli.stages.pipeline import Pipeline
    from koopcli.stages.verdict import NAMES, fitted_to_test_data, verdict

    about = {"fitted_to_test_data": fitted_to_test_data(artefact.record, call.pipeline.store)}
    if about["fitted_to_test_data"]:
        call.console.warn(
            "the predictor was fitted to these test trajectories, so its scores say how well it fits, not how well it "
            "predicts: test it on others, such as those of another seed"
        )
    if not others:
        call.console.note(
            "there are no baselines: the data that this predictor was fitted to are no longer in the store"
        )
        return about
    quiet = Pipeline(call.pipeline.store, _Unwarned(call.console), call.pipeline.workers)
    names, figures = {}, {}
    for name, baseline in others.items():
        scored = quiet.make(baseline)
        names[name], figures[name] = scored.record.name, scored.figures
        del scored  # its scores may be many
    rows = [["this predictor", *_scores(artefact.figures)]]
    rows += [[NAMES[name], *_scores(values)] for name, values in figures.items()]
    header = ["RMSE in %", "mean ± std", "median", "max", "re-lifted", "inside"]
    show_table(header, rows, file=sys.stderr)
    for segment in artefact.figures.get("segments", []):
        call.console.note(f"from sample {segment['start']:>4}: RMSE {segment['rmse']:.4g} %")
    judgement = verdict(artefact.figures, figures)
    (call.console.note if judgement.beats else call.console.warn)(judgement.text)
    told = None
    if not judgement.beats and not about["fitted_to_test_data"]:
        told = advice(typed, call, task, artefact.figures)
    if told is not None:
        call.console.note(told)
    scores = {name: {"name": names[name], "rmse": figures[name]["rmse"]} for name in others}
    return {**about, "baselines": scores, "beats_baselines": judgement.beats, "verdict": judgement.text, "advice": told}


def _scores(figures: dict[str, Any]) -> list[str]:
    rmse = figures["rmse"]
    others = [rmse["median"], rmse["max"], figures["rmse_relift"]["mean"], figures["rmse_in_domain"]["mean"]]
    return [
        f"{rmse['mean']:.4g} ± {rmse['std']:.3g}",
        *("–" if math.isnan(value) else f"{value:.4g}" for value in others),
    ]


class _Unwarned:
    """A console that shows no warnings: a baseline is meant to be poor."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self.note, self.progress = console.note, console.progress

    def warn(self, text: str) -> None:
        """Nothing."""


def register(app: typer.Typer) -> None:
    """Add the command of this file."""
    app.command("evaluate")(evaluate)
