"""Executions that judge a feedback model, in every setting."""

from structlearn.feedback.skill import ReactiveSkill
from structlearn.recordings.clock import synchronise
from structlearn.recordings.recording import Recording
from structlearn.recordings.source import ClockParameters
from structlearn.segmentation.execution_cuts import commanded_cuts
from structlearn.testbeds.scraping.protocol.executed_sets import EvaluationParameters, ExecutedSet
from structlearn.testbeds.scraping.protocol.executions import evaluation_runs, executions
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def executed_set(
    model: str,
    skill: ReactiveSkill,
    parameters: EvaluationParameters,
    testbed: TestbedParameters,
    clock: ClockParameters,
) -> tuple[dict[float, list[Recording]], ExecutedSet]:
    """Execute a skill in every setting.

    `skill`: with the networks of that model, or with none. `parameters`: settings and number of runs; runs of
    equal number meet equal conditions in every set. Returns the recordings by setting, and the set.
    """
    runs = evaluation_runs(parameters.settings_deg, parameters.runs, feedback=bool(skill.networks))
    recordings = executions(skill, runs, testbed)
    names = [primitive.name for primitive in skill.primitives]
    by_setting, read, cuts = {}, {}, {}
    for place, setting in enumerate(parameters.settings_deg):
        by_setting[setting] = recordings[place * parameters.runs : (place + 1) * parameters.runs]
        read[setting] = [synchronise(one, clock.rate_hz, clock.max_gap_s) for one in by_setting[setting]]
        cuts[setting] = commanded_cuts(read[setting], names)
    networks = {name: one for name, by_axis in skill.networks.items() for one in by_axis.values()}
    return by_setting, ExecutedSet(model, networks, read, cuts)
