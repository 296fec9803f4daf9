"""Guided demonstrations of the scraping task: a person moves the arm by hand (IV.9.1.3, step i)."""

from functools import partial

import numpy as np

from structlearn.ground import quaternion
from structlearn.ground.parallel import parallel_map
from structlearn.recordings.recording import Recording
from structlearn.simulation.fingers import FingerPair
from structlearn.testbeds.scraping.world.demonstrator import (
    DemonstratorParameters,
    Intention,
    first_stamp,
    intended_movements,
    orientation_of,
)
from structlearn.testbeds.scraping.world.execution import execute
from structlearn.testbeds.scraping.world.guidance import guided_motion, pressure
from structlearn.testbeds.scraping.world.recorder import provenance, recorded
from structlearn.testbeds.scraping.world.testbed import TestbedParameters, finger_rate, run_conditions


def guided_demonstrations(
    demonstrator: DemonstratorParameters, testbed: TestbedParameters
) -> list[Recording]:
    """Nominal demonstrations by a person who guides the arm on the flat board.

    Returns recordings "01", "02", ... with `true_segments` (3, 2) of the intended movement.
    """
    movements = intended_movements(demonstrator, testbed.world.control_rate_hz)
    guide = partial(_guide, testbed=testbed, seed=demonstrator.seed)
    return parallel_map(guide, movements, "guided demonstrations")


def _guide(movement: Intention, testbed: TestbedParameters, seed: int) -> Recording:
    conditions_rng, fingers_rng, wrist_rng, clocks_rng = (
        np.random.default_rng(child) for child in movement.run.spawn(4)
    )
    ticks = len(movement.time)
    own = testbed.guidance
    conditions = run_conditions(
        testbed,
        0.0,
        conditions_rng,
        stiffness=(2.0 * np.pi * own.frequency_hz) ** 2,
        force=pressure(own, ticks, testbed.world.dt, conditions_rng),
        gains=(0.0, own.force_i_m_n_s),
    )
    first = orientation_of(movement.tilt[:1] + movement.tilt_noise[:1])[0]
    start = (movement.edge[0] + movement.edge_noise[0], quaternion.matrix(first))
    fingers = FingerPair(testbed.touch, testbed.sensor_seed, fingers_rng, finger_rate(testbed))
    log = execute(
        testbed.world,
        guided_motion(movement),
        start,
        ticks,
        conditions,
        testbed.control,
        fingers,
        wrist_rng,
    )
    return recorded(
        movement.name,
        first_stamp(int(movement.name) - 1),
        log,
        movement.segments,
        provenance("a person guides the arm", 0.0, str(seed)),
        testbed.world.dt,
        testbed.recorder,
        clocks_rng,
    )
