import numpy as np
import pytest
import torch
from rigid_body_robots import (
    COULOMB,
    VISCOUS,
    arm,
    carrying,
    motion_with_friction,
    pinocchio_torques,
    robot_with,
)

from dissertation.simulation.arm import Payload
from structlearn.core.errors import InputError
from structlearn.rigid_body import identification, payload
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.log_fitness import current_delays, moving_gains, resting_gains
from structlearn.rigid_body.motion import Motion, excited, measured_motion
from structlearn.rigid_body.regressor import MotionRegressor

RNG = np.random.default_rng(0)


def sine(time):
    """Position, velocity, acceleration and a torque of two joints."""
    frequencies = np.array([1.0, 2.5])
    angle = time[:, None] * frequencies
    position, velocity = np.sin(angle), frequencies * np.cos(angle)
    return position, velocity, -(frequencies**2) * position, 3.0 * position + velocity


def test_an_irregular_noisy_log_gives_the_motion_behind_it():
    time = np.cumsum(RNG.uniform(0.5e-3, 1.5e-3, 12_000))
    position, velocity, _, torque = sine(time)
    noisy = [values + RNG.normal(0.0, 0.02, values.shape) for values in (position, velocity, torque)]
    motion = measured_motion("log", time, *noisy, rate_hz=500.0, cutoff_hz=5.0)
    ticks = time[0] + np.arange(len(motion)) / 500.0
    inside = slice(200, -200)
    for found, true, error in zip(
        (motion.q, motion.qd, motion.qdd, motion.torque), sine(ticks), (0.01, 0.01, 0.3, 0.02), strict=True
    ):
        assert np.abs(found - true)[inside].max() < error
    torch.from_numpy(motion.torque)  # torch refuses the filter's reversed arrays


def test_a_regular_log_without_low_pass_stays_as_it_is():
    time = 7.0 + 0.004 * np.arange(500)
    position, velocity, acceleration, torque = sine(time)
    motion = measured_motion("log", time, position, velocity, torque)
    np.testing.assert_allclose(motion.q, position, atol=1e-9)
    np.testing.assert_allclose(motion.torque, torque, atol=1e-9)
    np.testing.assert_allclose(motion.qdd, acceleration, atol=1e-3)  # central differences


def test_the_first_part_is_split_off_in_the_order_of_time():
    time = 0.01 * np.arange(100)
    first, rest = measured_motion("log", time, *[sine(time)[part] for part in (0, 1, 3)]).split(0.6)
    assert (len(first), len(rest)) == (60, 40)
    np.testing.assert_allclose(np.vstack([first.q, rest.q]), sine(time)[0], atol=1e-9)


def test_a_log_without_torques_or_time_is_refused():
    time = 0.01 * np.arange(100)
    position, velocity, _, torque = sine(time)
    torque[:, 1] = 0.0
    with pytest.raises(InputError, match="log: the torque of joint 2 does not vary"):
        measured_motion("log", time, position, velocity, torque)
    with pytest.raises(InputError, match=r"log: 0\.01 s are too short for a motion at 100 Hz"):
        measured_motion("log", time[:2], position[:2], velocity[:2], torque[:2])


FRICTION = ("viscous", "coulomb")
NOISE = np.random.default_rng(0)
GAINS = np.array([12.0, 8.0, 10.0])


def test_gains_at_rest_are_the_ratio_and_silent_joints_have_none():
    torque = np.array([0.0, -40.0, 7.0]) * (1.0 + 1e-3 * NOISE.normal(size=(400, 3)))
    current = torque / GAINS + np.array([0.0, 1e-4, 1e-4]) * NOISE.normal(size=(400, 3))
    gains, drawn = resting_gains(current, torque, 50, 200, seed=0)
    np.testing.assert_array_equal(np.isnan(gains), [True, False, False])
    np.testing.assert_allclose(gains[1:], GAINS[1:], rtol=1e-3)
    low, high = np.quantile(drawn[:, 1:], [0.001, 0.999], axis=0)
    assert ((low <= gains[1:]) & (gains[1:] <= high)).all()


def test_gains_in_motion_are_found_beside_friction():
    time = 0.01 * np.arange(4000)[:, None]
    velocity = np.sin(time * [1.0, 1.7, 2.3])
    torque = np.array([30.0, 60.0, 5.0]) * np.cos(time * [0.9, 1.3, 2.0] + 1.0)
    friction = 0.3 * velocity + np.sign(velocity) * (0.4 + 0.2 * np.exp(-np.abs(velocity) / 0.1))
    gains, drawn = moving_gains(torque / GAINS + friction, torque, velocity, 200, 100, seed=0)
    np.testing.assert_allclose(gains, GAINS, rtol=1e-6)
    assert drawn.shape == (100, 3)


def test_delays_of_currents_are_found_joint_by_joint():
    motion, dt = motion_with_friction(arm()), 0.02
    delays = dt * np.linspace(-0.5, 1.5, 9)
    late = np.linspace(-0.005, 0.025, motion.joints)
    ticks = dt * np.arange(len(motion))
    pairs = zip(late, motion.torque.T, strict=True)
    measured = [np.interp(ticks, ticks + its, column) for its, column in pairs]
    tried = [[np.interp(ticks + delay, ticks, column) for column in measured] for delay in delays]
    tried = np.swapaxes(tried, 1, 2)
    found, drawn, squares = current_delays(arm().tree, motion, tried, delays, FRICTION, 100, 50, seed=0)
    np.testing.assert_allclose(found, late, atol=0.003)
    assert drawn.shape == (50, 7)
    assert squares.min() == pytest.approx(1.0)


def loaded_pair(payload: Payload, noise: float) -> tuple[Motion, Motion]:
    """The same motion without and with a payload, friction in both."""
    empty = motion_with_friction(arm())
    friction_torque = friction_columns(empty.q, empty.qd, FRICTION) @ [VISCOUS, COULOMB]
    heavier = robot_with(arm(), carrying(arm(), payload))
    torque = pinocchio_torques(heavier, empty.q, empty.qd, empty.qdd) + friction_torque
    scale = noise * np.sqrt(empty.torque_variance)
    pair = (empty.torque, torque)
    return tuple(
        Motion(empty.q, empty.qd, empty.qdd, its + scale * NOISE.normal(size=its.shape)) for its in pair
    )


def test_a_load_is_found_from_what_it_changes():
    carried = Payload(2.5, (0.03, -0.02, 0.1), 0.05)
    exact = [loaded_pair(carried, 0.0)]
    load, _ = payload.identify_load(arm().tree, exact, FRICTION, 100, 10, seed=0)
    assert load[0] == pytest.approx(2.5, rel=1e-6)
    np.testing.assert_allclose(load[1:4], 2.5 * np.array(carried.point_m), atol=1e-6)
    noisy = [loaded_pair(carried, 0.05) for _ in range(2)]
    one, drawn = payload.identify_load(arm().tree, noisy[:1], FRICTION, 100, 60, seed=0)
    both, tighter = payload.identify_load(arm().tree, noisy, FRICTION, 100, 60, seed=0)
    for found, its in ((one, drawn), (both, tighter)):
        assert abs(found[0] - 2.5) < 3.0 * its[:, 0].std()
        assert its[:, 0].mean() == pytest.approx(found[0], abs=0.5 * its[:, 0].std())
    assert tighter[:, 0].std() < drawn[:, 0].std()


def test_intervals_of_inertias_are_tight_where_torques_show_them_and_nothing_is_noise():
    motion = motion_with_friction(arm())
    regressor = MotionRegressor(arm().tree, motion, True, FRICTION)
    free, friction = identification.fit_structure(
        "cov", identification.normalised_triangle(regressor.factors), FRICTION, arm().inertias, 300
    )
    model = DynamicsModels("cov", arm().tree.names, FRICTION, (), {"inertia": free, "friction": friction})
    drawn = identification.drawn_fits(model, regressor, arm().inertias, 50, 200, 2, seed=0)
    assert drawn.inertias().mass.shape == (2, 7)
    np.testing.assert_allclose(drawn.friction_coefficients()[..., 1], COULOMB, rtol=0.1)
    # the torques show the sum of masses and levers only; what they do not show stays where it was
    np.testing.assert_allclose(drawn.inertias().mass[:, 0], arm().inertias.mass[0], rtol=1e-3)


def test_rests_and_the_way_to_the_start_are_cut_off():
    speed = np.concatenate([np.zeros(30), np.ones(20), np.zeros(60), np.ones(100), np.zeros(10), np.ones(50)])
    still = np.zeros_like(speed)
    assert excited("log", np.stack([still, speed], axis=1), 0.02, 40) == slice(110, 270)
    assert excited("log", speed[:, None], 0.02, 5) == slice(110, 210)
    with pytest.raises(InputError, match=r"log: no joint ever moves faster than 0\.02 rad/s"):
        excited("log", still[:, None], 0.02, 5)
