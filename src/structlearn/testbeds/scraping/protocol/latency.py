"""What controller and simulation cost on this machine; such times stand in a file of their own."""

import time

import numpy as np
from pydantic import Field

from structlearn.core.artefacts import Metrics
from structlearn.core.params import Parameters
from structlearn.feedback.runtime import Controller, tick_latency
from structlearn.feedback.skill import ReactiveSkill
from structlearn.testbeds.scraping.protocol.executions import evaluation_runs, execute_run
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

WARM_UP_RUNS = 1  # Runs before those that count: the first one compiles, or loads what was compiled
STANDARD_RUN_S = 10.0  # s of movement to which the cost of a run is scaled


class TimingParameters(Parameters):
    """What is timed."""

    controller_hz: float = Field(gt=0)
    ticks: int = Field(ge=100)
    runs: int = Field(ge=1)


def controller_latency(skill: ReactiveSkill, parameters: TimingParameters) -> Metrics:
    """Time ticks of the controller with feedback.

    `parameters`: rate and number of ticks. Returns `controller_tick_us_median`, `controller_tick_us_p99` and
    `controller_tick_us_max`.
    """
    microseconds = 1e6 * tick_latency(Controller(skill, parameters.controller_hz), parameters.ticks).seconds
    return {
        "controller_tick_us_median": float(np.median(microseconds)),
        "controller_tick_us_p99": float(np.percentile(microseconds, 99)),
        "controller_tick_us_max": float(microseconds.max()),
    }


def run_cost(skill: ReactiveSkill, testbed: TestbedParameters, parameters: TimingParameters) -> Metrics:
    """Time whole simulated runs with feedback, the start of the world included.

    `parameters`: number of runs. Returns `simulated_run_cpu_s`, median CPU seconds scaled to `STANDARD_RUN_S`
    of movement.
    """
    costs = []
    for index, run in enumerate(evaluation_runs([10.0], WARM_UP_RUNS + parameters.runs, feedback=True)):
        begin = time.process_time()
        recording = execute_run(run, index, skill, testbed)
        spent = time.process_time() - begin
        stamps = recording.streams[0].stamps
        costs.append(spent * STANDARD_RUN_S / (1e-9 * float(stamps[-1] - stamps[0])))
    return {"simulated_run_cpu_s": float(np.median(costs[WARM_UP_RUNS:]))}
