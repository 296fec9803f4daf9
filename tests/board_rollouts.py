"""A small board of the scraping task, on which rollouts take a fraction of a second each."""

from dataclasses import replace
from functools import cache

import numpy as np
from committed import committed
from scraping_motions import NAMES, scraping_skill

from dissertation.scraping.protocol.board_refinement import BoardEnvironment
from dissertation.scraping.protocol.execution_scores import nominal_orientation
from dissertation.scraping.protocol.executions import execute_run, nominal_runs
from dissertation.scraping.world.testbed import TestbedParameters
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.skill import Limits
from structlearn.readers.clock import synchronise
from structlearn.readers.source import ClockParameters

RATE_HZ = 300.0
TESTBED = committed(TestbedParameters, "testbed")
LIMITS = Limits(largest_coupling={"ry": 60.0})
POLICY = np.linspace(-10.0, -5.0, 25)
SEED = (1, 0, 2)


@cache
def small_board():
    """The second of three primitives on a board of 5 degrees."""
    skill = scraping_skill()
    (run,) = nominal_runs(1)
    nominal = synchronise(execute_run(run, 0, skill, TESTBED), RATE_HZ)
    return BoardEnvironment(
        skill=replace(skill, networks={}, limits=LIMITS),
        preceding={},
        name="turn",
        setting_deg=5.0,
        nominal=nominal_orientation([nominal]),
        supervision=committed(
            SupervisionParameters, "coupling_dataset", primitives=NAMES[1:], settings_deg=(5.0,)
        ),
        testbed=TESTBED,
        clock=committed(ClockParameters, "clock", rate_hz=RATE_HZ),
    )


def same(one, other):
    """Whether two rollouts are equal to the last bit."""
    return np.array_equal(one.cost, other.cost) and all(
        np.array_equal(values, vars(other.samples)[name]) for name, values in vars(one.samples).items()
    )
