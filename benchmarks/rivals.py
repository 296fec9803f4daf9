"""How long each method of the study of rivals trains, and how long a decision takes.

    python benchmarks/rivals.py [--output reports/benchmarks/rivals.csv]

With all demonstrations of the person whom `params.yaml` names, in processor time of one thread. It needs some
minutes, most of them for demonstrations.
"""

import argparse
import os
from pathlib import Path
from time import process_time

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", NUMBA_NUM_THREADS="1")

import numpy as np
import pandas as pd
from timing import machine

from dissertation.rivals.imitation_data import first, recorded_person
from dissertation.rivals.policies import Ensemble, Policy
from dissertation.rivals.protocol import MODELS, ComparisonParameters, MethodParameters, trained
from dissertation.simulation.fingers import CHANNELS
from structlearn.core.artefacts import write_csv
from structlearn.core.stage import stage_parameters
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.sequence import default_start

DECISIONS = 1000


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, help="write the rows to this CSV file too")
    options = parser.parse_args()
    parameters = stage_parameters("rivals", ComparisonParameters)
    methods = stage_parameters("rival_methods", MethodParameters)
    _, bench, recorded = recorded_person(parameters.demonstrations)
    rate_hz, rows = bench.testbed.world.control_rate_hz, []
    for model in MODELS[1:]:
        trained(bench, first(recorded, 1), getattr(methods, model), parameters.seed)  # compiles
        begin = process_time()
        method = trained(bench, recorded, getattr(methods, model), parameters.seed).keywords
        training_s = process_time() - begin
        if policy := method.get("policy"):
            rate = bench.testbed.finger_rate_hz / policy.parameters.every
            rows.append((model, training_s, 1e3 * decision_s(policy), rate))
        else:
            rows.append((model, training_s, 1e3 * tick_s(method["skill"], rate_hz), rate_hz))
    table = pd.DataFrame(rows, columns=["method", "training_s", "decision_ms", "rate_hz"])
    print(machine(), table.to_string(index=False), sep="\n")
    if options.output:
        write_csv(table, options.output)


def decision_s(policy: Policy) -> float:
    """Seconds of a rival's decision: a pass of its network, and the ensemble."""
    seen = policy.pose.mean, policy.task.mean, policy.touch.mean
    ensemble = Ensemble()
    begin = process_time()
    for _ in range(DECISIONS):
        ensemble.update(policy.chunk(*seen))
    return (process_time() - begin) / DECISIONS


def tick_s(skill: ReactiveSkill, rate_hz: float) -> float:
    """Seconds of a tick of our controller with new readings, mean over a run."""
    controller, start = Controller(skill, rate_hz), default_start(skill.primitives)
    counts = np.zeros(CHANNELS)
    for _ in range(2):  # the first run compiles
        ticks = 0
        controller.start(start.position, start.orientation)
        begin = process_time()
        while not controller.finished:
            controller.tick(counts)
            ticks += 1
        seconds = process_time() - begin
    return seconds / ticks


if __name__ == "__main__":
    main()
