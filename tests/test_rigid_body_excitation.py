"""Excitation of an arm for its identification: D-optimal, within all limits, the same by seed."""

import numpy as np
import pytest
from scipy.stats import chi2

from structlearn.core.errors import InputError
from structlearn.rigid_body import excitation
from structlearn.rigid_body.tree import read_urdf

PARAMETERS = excitation.ExcitationParameters(
    harmonics=2, period_s=4.0, rate_hz=100.0, share=0.9, starts=4, iterations=40, seed=0
)
TIMES = np.linspace(0.0, 4.0, 81)[:-1]

JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{offset} 0 0"/><axis xyz="0 -1 0"/>'
    '<limit lower="-2" upper="1.5" velocity="3" effort="{effort}"/></joint>'
)
LINK = (
    '<link name="{name}"><inertial><origin xyz="0.2 0 0.05"/><mass value="{mass}"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>'
)


def two_joints(folder, effort=60.0):
    """Two links in a vertical plane."""
    parts = ['<robot name="two"><link name="base"/>', LINK.format(name="upper", mass=3.0)]
    parts += [LINK.format(name="lower", mass=1.5)]
    parts += [JOINT.format(name="shoulder", parent="base", child="upper", offset=0.0, effort=effort)]
    parts += [JOINT.format(name="elbow", parent="upper", child="lower", offset=0.4, effort=effort)]
    path = folder / "two.urdf"
    path.write_text("".join([*parts, "</robot>"]))
    return excitation.arena(read_urdf(path), PARAMETERS)


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
        times, motion = excitation.written(its, free, PARAMETERS.rate_hz)
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
    assert excitation.written(weak, fast, 100.0)[0][-1] > excitation.written(strong, fast, 100.0)[0][-1]
    with pytest.raises(InputError, match="own weight"):
        excitation.written(two_joints(tmp_path, 1.0), fast, 100.0)


def test_the_same_seed_designs_the_same(its, best):
    again = excitation.design(its, PARAMETERS.starts, PARAMETERS.iterations, PARAMETERS.seed)[0]
    np.testing.assert_array_equal(again, best)


def test_errors_in_simulated_logs_are_those_that_the_information_predicts(its, best):
    _, motion = excitation.written(its, best, PARAMETERS.rate_hz)
    noise, draws = 0.01 * its.effort, 400
    known = excitation.information(its, motion.q, motion.qd, motion.qdd) / 0.01**2
    expected = np.sqrt(np.diag(np.linalg.inv(known)))
    found = excitation.parameter_errors(its, motion, noise, draws, 0)
    low, high = np.sqrt(chi2.ppf([1e-4, 1.0 - 1e-4], draws) / draws)
    assert np.all((found / expected > low) & (found / expected < high))
