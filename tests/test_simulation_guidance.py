"""A person guides the arm by hand along an intended movement and presses by feel."""

import numpy as np
import pytest
from committed import committed
from scraping_motions import conditions

from structlearn.ground import quaternion
from structlearn.simulation.fingers import FingerPair, TouchParameters
from structlearn.testbeds.scraping.world.demonstrator import (
    DemonstratorParameters,
    intended_movements,
    orientation_of,
)
from structlearn.testbeds.scraping.world.execution import ControlParameters, execute
from structlearn.testbeds.scraping.world.guided_demonstrations import guided_motion, pressure
from structlearn.testbeds.scraping.world.scraping_world import WorldParameters
from structlearn.testbeds.scraping.world.testbed import GuidanceParameters

DT = 1 / 300
GUIDANCE = committed(GuidanceParameters, "testbed.guidance")


@pytest.fixture(scope="module")
def movement():
    quick = {"durations_s": (0.8, 1.0, 0.8), "rest_s": (0.1, 0.1), "pause_s": (0.1, 0.1)}
    (one,) = intended_movements(
        committed(DemonstratorParameters, "simulate", count=1, seed=0, hesitation_probability=0.0, **quick)
    )
    return one


@pytest.fixture(scope="module")
def guided(movement):
    ticks = len(movement.time)
    run = conditions(
        0.0,
        ticks,
        stiffness=(2 * np.pi * GUIDANCE.frequency_hz) ** 2,
        force=np.full(ticks, GUIDANCE.force_n),
        force_gains=(0.0, GUIDANCE.force_i_m_n_s),
    )
    first = orientation_of(movement.tilt[:1] + movement.tilt_noise[:1])[0]
    start = (movement.edge[0] + movement.edge_noise[0], quaternion.rotate(first, np.eye(3)).T)
    control = committed(ControlParameters, "testbed.control")
    fingers = FingerPair(committed(TouchParameters, "testbed.touch"), 1, np.random.default_rng(2), 100.0)
    world, motion = committed(WorldParameters, "testbed.world"), guided_motion(movement)
    return execute(world, motion, start, ticks, run, control, fingers, np.random.default_rng(3))


def test_a_motion_is_the_intended_movement_tick_by_tick(movement):
    motion = guided_motion(movement)
    np.testing.assert_array_equal(motion.position, movement.edge + movement.edge_noise)
    travelled = movement.edge[0] + np.cumsum(motion.velocity, axis=0) * DT
    np.testing.assert_allclose(travelled, movement.edge, atol=1e-3)  # the noise is not fed forward
    switches = np.flatnonzero(np.diff(motion.primitive)) + 1
    np.testing.assert_allclose(movement.time[switches], movement.segments[1:, 0], atol=DT)
    assert sorted(set(motion.primitive)) == [0, 1, 2]


def test_the_arm_follows_the_intended_path(movement, guided):
    """Sideways within a few mm, and no further into the board than the pressure asks for."""
    off = guided.position - movement.edge
    assert np.linalg.norm(off[:, :2], axis=1).max() < 3e-3
    in_the_air = movement.time < movement.contact - 0.1
    assert np.abs(off[in_the_air, 2]).max() < 3e-3
    turned = quaternion.angle_between(guided.orientation, orientation_of(movement.tilt))
    assert np.degrees(turned).max() < 3.0


def test_the_pressure_settles_where_it_is_meant_to(movement, guided):
    down = -guided.wrench[:, 2]
    assert np.abs(down[movement.time < movement.contact - 0.2]).max() < 0.15
    assert down[movement.time > movement.contact + 1.2].mean() == pytest.approx(1.0, abs=0.1)


def test_people_reproduce_a_pressure_poorly_and_hold_it_better():
    own = committed(GuidanceParameters, "testbed.guidance", force_n=2.0)
    trials = np.array([pressure(own, 3000, DT, np.random.default_rng(seed)) for seed in range(60)])
    levels = np.log(trials.mean(axis=1) / 2.0)
    assert levels.mean() == pytest.approx(0.0, abs=3 * own.force_spread / 60**0.5)
    assert levels.std() == pytest.approx(own.force_spread, rel=0.3)
    within = trials.std(axis=1) / trials.mean(axis=1)
    assert within.mean() == pytest.approx(own.force_cv, rel=0.15)
    lag = round(own.force_fluctuation_s / DT)
    centred = trials - trials.mean(axis=1, keepdims=True)
    correlation = np.mean(centred[:, lag:] * centred[:, :-lag]) / np.mean(centred**2)
    assert correlation == pytest.approx(np.exp(-1), abs=0.08)
