"""A person guides the arm by hand (kinesthetic teaching): how nominal demonstrations are made (IV.9.1.3, i).

The arm is in gravity compensation; what the person's own arm does to it is again a pose reference with a
natural frequency, softer than the robot's. People who have practised compensate the inertia of what they hold
(Shadmehr & Mussa-Ivaldi 1994), so the intended velocity and acceleration are fed forward and only the noise
is filtered by the arm's inertia. Pressure on the board is regulated by feel, slowly.
"""

from functools import partial

import numpy as np

from structlearn.core import quaternion
from structlearn.core.parallel import parallel_map
from structlearn.readers.recording import Recording
from structlearn.simulation.fingers import FingerPair
from structlearn.testbeds.scraping.world.demonstrator import (
    DemonstratorParameters,
    Intention,
    first_stamp,
    intended_movements,
    orientation_of,
)
from structlearn.testbeds.scraping.world.execution import Reference, execute
from structlearn.testbeds.scraping.world.testbed import (
    GuidanceParameters,
    TestbedParameters,
    finger_rate,
    provenance,
    recorded,
    run_conditions,
)


def guided_motion(movement: Intention) -> Reference:
    """The intended movement as a pose reference."""
    step = movement.time[1]
    velocity = np.gradient(movement.edge, step, axis=0)
    turning = np.gradient(movement.tilt, step, axis=0)  # small angles: the vector's rate
    return Reference(
        position=movement.edge + movement.edge_noise,
        velocity=velocity,
        acceleration=np.gradient(velocity, step, axis=0),
        orientation=orientation_of(movement.tilt + movement.tilt_noise),
        angular_velocity=turning,
        angular_acceleration=np.gradient(turning, step, axis=0),
        primitive=np.searchsorted(movement.segments[1:, 0], movement.time, side="right"),
    )


def pressure(parameters: GuidanceParameters, ticks: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Force that the person means to press with, over the ticks of one trial: (ticks,) N."""
    from scipy.signal import lfilter

    level = parameters.force_n * np.exp(parameters.force_spread * rng.standard_normal())
    keep = np.exp(-dt / parameters.force_fluctuation_s)
    fluctuation = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(ticks))
    return level * (1.0 + parameters.force_cv * fluctuation)


def guided_demonstrations(
    demonstrator: DemonstratorParameters, testbed: TestbedParameters
) -> list[Recording]:
    """Nominal demonstrations by a person who guides the arm on the flat board.

    Returns recordings "01", "02", ... with `true_segments` (3, 2) of the intended movement.
    """
    movements = intended_movements(demonstrator, testbed.world.control_rate_hz)
    guide = partial(_guide, testbed=testbed, seed=demonstrator.seed)
    first, *others = movements
    # the first in this process, which compiles the robot once; each worker would do so again
    return [guide(first), *parallel_map(guide, others, "guided demonstrations")]


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
        testbed.world, guided_motion(movement), start, ticks, conditions, testbed.control, fingers, wrist_rng
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
