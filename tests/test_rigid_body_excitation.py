"""Excitation of an arm for its identification: D-optimal, within all limits, the same by seed."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_body_robots import joint, link
from scipy.signal import lfilter
from scipy.stats import chi2

from structlearn.core.errors import InputError
from structlearn.rigid_body import excitation, log_fitness
from structlearn.rigid_body.base_parameters import BaseFit, base_parameters, fit_base
from structlearn.rigid_body.excitation import limited_motion, random_series
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.robot import read_urdf

PARAMETERS = excitation.ExcitationParameters(
    harmonics=2, period_s=4.0, rate_hz=100.0, share=0.9, starts=4, iterations=40, seed=0
)
TIMES = np.linspace(0.0, 4.0, 81)[:-1]

LIMIT = '<limit lower="-2" upper="1.5" velocity="3" effort="{}"/>'


def two_joints(folder, effort=60.0):
    """Two links in a vertical plane."""
    parts = ['<robot name="two"><link name="base"/>']
    for name, parent, child, offset, mass in (
        ("shoulder", "base", "upper", 0.0, 3.0),
        ("elbow", "upper", "lower", 0.4, 1.5),
    ):
        origin, limit = f'xyz="{offset} 0 0"', LIMIT.format(effort)
        parts += [link(child, mass, "0.2 0 0.05")]
        parts += [joint(name, "revolute", parent, child, "0 -1 0", origin, limit)]
    path = folder / "two.urdf"
    path.write_text("".join([*parts, "</robot>"]))
    return excitation.design_problem(read_urdf(path), PARAMETERS)


def rated(its, free):
    return excitation.log_determinant(excitation.information(its, *excitation.series(its, free, TIMES)))


@pytest.fixture(scope="module")
def its(tmp_path_factory):
    return two_joints(tmp_path_factory.mktemp("two"))


@pytest.fixture(scope="module")
def best(its):
    return excitation.design(its, PARAMETERS.starts, PARAMETERS.iterations, PARAMETERS.seed)[0]


def test_no_series_of_many_tells_more_than_the_designed_one(its, best):
    generator = np.random.default_rng(1)
    others = 2.0 * generator.normal(size=(4_000, *its.free))
    near = best + 0.3 * generator.normal(size=(1_000, *its.free))
    for tried in (others, near):
        assert rated(its, tried).max() < rated(its, best) + 0.02
    assert rated(its, best) > np.median(rated(its, excitation.random_series(its, 100, 2))) + 1.0


def test_every_sample_is_within_the_limits_and_the_ends_are_at_rest(its, best):
    wild = 5.0 * np.random.default_rng(3).normal(size=(200, *its.free))
    for free in (best, *wild):
        times, motion = excitation.limited_motion(its, free, PARAMETERS.rate_hz)
        assert len(times) == len(motion)
        assert np.all(its.tree.lower <= motion.q.min(axis=0))
        assert np.all(motion.q.max(axis=0) <= its.tree.upper)
        assert np.all(np.abs(motion.qd) <= its.tree.velocity)
        assert np.all(np.abs(motion.torque) <= its.effort)
        np.testing.assert_allclose([motion.qd[0], motion.qdd[0]], 0.0, atol=1e-9)


def test_velocities_and_accelerations_are_those_of_the_positions(its):
    times = np.linspace(0.0, 4.0, 40_001)
    q, qd, qdd = excitation.series(its, excitation.random_series(its, 1, 0)[0], times)
    np.testing.assert_allclose(np.gradient(q, times, axis=0)[1:-1], qd[1:-1], atol=1e-6)
    np.testing.assert_allclose(np.gradient(qd, times, axis=0)[1:-1], qdd[1:-1], atol=1e-5)


def test_weak_drives_make_the_motion_slower_and_too_weak_ones_are_an_error(tmp_path):
    strong, weak = two_joints(tmp_path, 60.0), two_joints(tmp_path, 15.0)
    fast = excitation.random_series(strong, 1, 0)[0]
    assert (
        excitation.limited_motion(weak, fast, 100.0)[0][-1]
        > excitation.limited_motion(strong, fast, 100.0)[0][-1]
    )
    with pytest.raises(InputError, match="own weight"):
        excitation.limited_motion(two_joints(tmp_path, 1.0), fast, 100.0)


def test_the_same_seed_designs_the_same(its, best):
    again = excitation.design(its, PARAMETERS.starts, PARAMETERS.iterations, PARAMETERS.seed)[0]
    np.testing.assert_array_equal(again, best)


def test_errors_in_simulated_logs_are_those_that_the_information_predicts(its, best):
    _, motion = excitation.limited_motion(its, best, PARAMETERS.rate_hz)
    noise, draws = 0.01 * its.effort, 400
    known = excitation.information(its, motion.q, motion.qd, motion.qdd) / 0.01**2
    expected = np.sqrt(np.diag(np.linalg.inv(known)))
    found = excitation.parameter_errors(its, motion, noise, draws, 0)
    low, high = np.sqrt(chi2.ppf([1e-4, 1.0 - 1e-4], draws) / draws)
    assert np.all((found / expected > low) & (found / expected < high))


RATE_HZ, CUTOFF_HZ, NOISE_N_M = 100.0, 5.0, 1.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """Robot, what is known of it, and its motion over eight periods."""
    folder = tmp_path_factory.mktemp("two")
    its = two_joints(folder)
    _, period = limited_motion(its, random_series(its, 1, 5)[0], RATE_HZ)
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
    table = log_fitness.identified_table(["a", "b", "c"], fit)
    assert table["parameter"].tolist() == ["a", "b", "c"]
    np.testing.assert_allclose(table["percent"], [5.0, 50.0, 300.0])
    assert table["determined"].tolist() == ["yes", "doubtful", "no"]
