"""What a log can identify, asked before it is learned from; and intervals that hold the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from test_rigid_body_excitation import two_joints

from structlearn.rigid_body import log_fitness
from structlearn.rigid_body.base_parameters import BaseFit, base_parameters, fit_base
from structlearn.rigid_body.excitation import random_series, written
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import read_urdf

RATE_HZ, CUTOFF_HZ, NOISE_N_M = 100.0, 5.0, 1.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Robot, what is known of it, and its motion over eight periods."""
    folder = tmp_path_factory.mktemp("two")
    its = two_joints(folder)
    _, period = written(its, random_series(its, 1, 5)[0], RATE_HZ)
    fields = (period.q, period.qd, period.qdd, period.torque)
    motion = Motion(*(np.concatenate([values[:-1]] * 8) for values in fields))
    return read_urdf(folder / "two.urdf"), its, motion


def noisy(motion, seed, correlated=0.8):
    """The motion with noise on the torques that neighbouring samples have in common."""
    white = np.random.default_rng(seed).normal(0.0, NOISE_N_M, motion.torque.shape)
    noise = lfilter([np.sqrt(1.0 - correlated**2)], [1.0, -correlated], white, axis=0)
    return replace(motion, torque=motion.torque + noise)


def answers(robot, motion, stamps=None):
    base = base_parameters(robot.tree)
    fit = fit_base(robot.tree, base, motion, (), 100, 100, 0)
    stamps = np.arange(len(motion)) / RATE_HZ if stamps is None else stamps
    return log_fitness.log_fitness(robot, [stamps], motion, (RATE_HZ, CUTOFF_HZ), fit, ()).set_index(
        ["question", "joint"]
    )


def test_intervals_hold_the_truth_in_95_of_100_logs(arm):
    robot, its, motion = arm
    held = []
    for seed in range(100):
        fit = fit_base(robot.tree, its.base, noisy(motion, seed), (), 100, 200, seed)
        held.append((fit.low <= its.theta) & (its.theta <= fit.high))
    assert 0.92 <= np.mean(held) <= 0.98
    assert np.mean(held, axis=0).min() >= 0.88  # of 100 logs, each parameter


def test_a_clean_log_is_fit(arm):
    robot, _, motion = arm
    its = answers(robot, noisy(motion, 0, 0.0))
    assert set(its["verdict"]) == {log_fitness.YES}, its
    assert all(line.startswith("  yes ") for line in log_fitness.fitness_lines(its.reset_index()))


def test_torques_that_are_late_are_noticed(arm):
    robot, _, motion = arm
    late = replace(motion, torque=np.roll(motion.torque, 2, axis=0))
    delay, _ = log_fitness.torque_delays(robot, late, RATE_HZ, ())
    np.testing.assert_allclose(delay, 0.02, atol=1e-3)


def test_gaps_limits_and_joints_at_rest_are_noticed(arm):
    robot, _, motion = arm
    stamps = np.arange(len(motion)) / RATE_HZ
    stamps[200:] += 0.5
    assert (
        answers(robot, noisy(motion, 0), stamps).loc["largest gap (periods of it)", "verdict"].item()
        == log_fitness.NO
    )
    cut = replace(motion, torque=np.clip(motion.torque, -60.0, 5.0))
    robot.model.effortLimit[:] = 5.0
    assert answers(robot, cut).loc[("torque at its limit (% of samples)", 1), "verdict"] == log_fitness.NO
    robot.model.effortLimit[:] = 60.0
    still = replace(motion, q=motion.q * [1.0, 0.01])
    assert answers(robot, still).loc[("range (rad)", 2), "verdict"] == log_fitness.NO


def test_parameters_are_told_by_how_well_they_are_determined():
    fit = BaseFit(1.0, np.array([1.0, -2.0, 0.1]), np.array([0.95, -3.0, -0.2]), np.array([1.05, -1.0, 0.4]))
    table = log_fitness.parameter_table(["a", "b", "c"], fit)
    assert table["parameter"].tolist() == ["a", "b", "c"]
    np.testing.assert_allclose(table["percent"], [5.0, 50.0, 300.0])
    assert table["determined"].tolist() == ["yes", "doubtful", "no"]
