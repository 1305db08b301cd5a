"""Stage ``sample``: initial states and inputs, the only place where a dataset is drawn."""

from __future__ import annotations

from koopcli.checks import restored
from koopcli.records import Meta, Sample
from koopcli.simulation.samples.sample import SampleChoice
from koopcli.stages.base import Context, Cost, Inputs, Stage, Task, refuse_beyond_memory


def _run(settings: SampleChoice, inputs: Inputs, context: Context) -> Sample:
    plant, drawn = settings.meant_for, settings.sampled(context.progress)
    return Sample(drawn.factors, drawn.states, drawn.inputs, bool(drawn.factors), plant.states, plant.inputs)


def _figures(sample: Sample) -> Meta:
    states, rows = sample.starts, len(sample.inputs)
    return {"states": states, "inputs": rows, "trajectories": states * rows if sample.crossed else states}


def _check(task: Task) -> None:
    task.settings.check()
    refuse_beyond_memory("the sample", _estimate(task).bytes, "sample.count")


def _estimate(task: Task) -> Cost:
    s = task.settings
    return Cost(s.seconds + 2e-8 * s.numbers, 8.0 * s.numbers)


STAGE = Stage(
    name="sample",
    version=2,
    settings=lambda values: restored(SampleChoice, values),
    run=_run,
    unpack=Sample.unpack,
    figures=_figures,
    describe=lambda f, settings: f"{f['states']} states, {f['inputs']} input rows, {f['trajectories']} trajectories",
    check=_check,
    estimate=_estimate,
)
