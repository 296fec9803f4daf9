import numpy as np
import pytest
import torch

from structlearn.core.errors import InputError
from structlearn.rigid_body.motion import measured_motion

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
