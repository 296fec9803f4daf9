"""Of a cell of the study `scraping/people`, what can be run again in 20 s: all until feedback is learned.

Demonstrations are recorded, cut and learned from, and what is learned is executed without feedback on every
tilt. Reads `params.yaml` of the working folder, which holds the person's seeds; writes `numbers.json` there,
with the keys of the study's table.
"""

from structlearn.core.artefacts import Metrics, write_metrics
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_targets import ExpectedTracesParameters, SupervisionParameters
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, cross_validation, learn_sequence
from structlearn.readers.clock import synchronise
from structlearn.readers.source import ClockParameters
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import level_name
from structlearn.segmentation.cut_errors import downsampling_effect
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut
from structlearn.testbeds.scraping.page.board_results import ExecutionResults
from structlearn.testbeds.scraping.page.findings import segmentation_of_one
from structlearn.testbeds.scraping.page.results import SegmentationResults
from structlearn.testbeds.scraping.protocol import execution_scores
from structlearn.testbeds.scraping.protocol.cut_sweep import SweepParameters, downsampling_sweep, noise_sweep
from structlearn.testbeds.scraping.protocol.execution_scores import nominal_orientation
from structlearn.testbeds.scraping.protocol.executions import executed_set, executions, nominal_runs
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.testbed import TestbedParameters, guided_demonstrations

NOT_OF_ONE = ("demonstrations", "simulated", "sweep_", "wls_wins", "downsampling_")
"""Beginnings of numbers that are not compared: known beforehand, or of sweeps, which take longer."""


def main() -> None:
    """Run the cell as far as it is cheap, and write its numbers."""
    segmentation = _segmentation()
    primitives = [primitive.name for primitive in segmentation.primitives]
    rows = Findings()
    segmentation_of_one(rows, segmentation)
    found = rows.numbers() | _costs(ReactiveSkill(segmentation.primitives), primitives)
    write_metrics(
        {key: value for key, value in found.items() if not key.startswith(NOT_OF_ONE)}, "numbers.json"
    )


def _segmentation() -> SegmentationResults:
    """Demonstrations, their cuts, and the primitives learned from these."""
    person = stage_parameters("simulate", DemonstratorParameters)
    parameters = stage_parameters("segment", SegmentParameters)
    fit = stage_parameters("fit_primitives", FitParameters)
    clock = stage_parameters("clock", ClockParameters)
    sweep = stage_parameters("segment_sweep", SweepParameters)
    recordings = guided_demonstrations(person, stage_parameters("testbed", TestbedParameters))
    demonstrations = [synchronise(one, clock.rate_hz, clock.max_gap_s) for one in recordings]
    cuts = cut(demonstrations, parameters)
    primitives, dt = learn_sequence(demonstrations, cuts.results, fit), 1.0 / clock.rate_hz
    situation = stage_parameters("generalise", sequence.GeneraliseParameters)
    shortest = sweep.model_copy(update={"noise_mm": sweep.noise_mm[:1], "seeds": 1})
    return SegmentationResults(
        demonstrations=demonstrations,
        segmentation=cuts,
        noise=noise_sweep(shortest, person, parameters),
        downsampling=downsampling_effect(demonstrations, parameters, sweep.downsampling[:1]),
        downsampling_people=downsampling_sweep(
            shortest.model_copy(update={"downsampling": sweep.downsampling[:1]}), person, parameters
        ),
        primitives=primitives,
        reproduction=cross_validation(demonstrations, cuts.results, fit),
        nominal=sequence.sequence_table(sequence.unroll(primitives, dt), cuts.primitives),
        generalised=sequence.sequence_table(sequence.generalised(primitives, dt, situation), cuts.primitives),
        segment_parameters=parameters,
        fit_parameters=fit,
    )


def _costs(skill: ReactiveSkill, primitives: list[str]) -> Metrics:
    """Accumulated cost without feedback, by primitive and tilt."""
    testbed = stage_parameters("testbed", TestbedParameters)
    clock = stage_parameters("clock", ClockParameters)
    evaluation = stage_parameters("evaluate_feedback", execution_scores.EvaluationParameters)
    supervision = stage_parameters("coupling_dataset", SupervisionParameters)
    count = stage_parameters("expected_traces", ExpectedTracesParameters).runs
    unrolls = executions(skill, nominal_runs(count), testbed)
    on_level = nominal_orientation([synchronise(one, clock.rate_hz, clock.max_gap_s) for one in unrolls])
    executed = executed_set(execution_scores.NOMINAL, skill, evaluation, testbed, clock)
    scores = execution_scores.scores([executed], on_level, supervision)
    costs = ExecutionResults(scores, {}, max(evaluation.settings_deg), supervision.unit_axis).costs
    return {
        f"cost_nominal_prim{primitives.index(row.primitive) + 1}_{level_name(row.setting_deg)}": row.mean
        for row in costs.itertuples()
    }


if __name__ == "__main__":
    run(main)
