"""Executions that judge a feedback model, in every setting."""

from structlearn.feedback.skill import ReactiveSkill
from structlearn.recordings.clock import synchronise
from structlearn.recordings.source import ClockParameters
from structlearn.segmentation.segments import commanded_cuts
from structlearn.testbeds.scraping.protocol.execution_scores import EvaluationParameters, ExecutedSet
from structlearn.testbeds.scraping.protocol.executions import evaluation_runs, executions
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def executed_set(
    model: str,
    skill: ReactiveSkill,
    parameters: EvaluationParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> ExecutedSet:
    """Execute a skill in every setting.

    `skill`: with the networks of that model, or with none. `parameters`: settings and number of runs; runs of
    equal number meet equal conditions in every set.
    """
    runs = evaluation_runs(parameters.settings_deg, parameters.runs, feedback=bool(skill.networks))
    recordings = executions(skill, runs, testbed)
    names = [primitive.name for primitive in skill.primitives]
    by_setting, cuts = {}, {}
    for place, setting in enumerate(parameters.settings_deg):
        its = recordings[place * parameters.runs : (place + 1) * parameters.runs]
        by_setting[setting] = [synchronise(one, clock.rate_hz, clock.max_gap_s) for one in its]
        cuts[setting] = commanded_cuts(by_setting[setting], names)
    networks = {name: one for name, by_axis in skill.networks.items() for one in by_axis.values()}
    return ExecutedSet(model, networks, by_setting, cuts)
