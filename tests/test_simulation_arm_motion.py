import numpy as np
import pytest
from committed import committed
from rigid_body_robots import robot as rigid_body_robot

from structlearn.ground.errors import InputError
from structlearn.ground.metrics import nmse
from structlearn.rigid_body import compiled_dynamics
from structlearn.simulation.arm import Arm, ArmParameters, ideal
from structlearn.testbeds.dynamics.world.arm_motion import (
    SineParameters,
    joint_feedback,
    run,
    sine_path,
    sine_policy,
)

SHORT = committed(SineParameters, "arm_motion", duration_s=4.0)


@pytest.fixture(scope="module")
def robot():
    return committed(ArmParameters, "arm").read()


@pytest.fixture(scope="module")
def feedback(robot):
    return joint_feedback(robot.tree, robot.inertias, SHORT.feedback)


def test_sines_have_the_periods_and_amplitudes_of_the_text(robot):
    long = committed(SineParameters, "arm_motion", duration_s=115.0)  # whole periods of some joints, nearly
    path = sine_path(robot.tree, long)
    limit = robot.tree.upper
    np.testing.assert_allclose(path.q.max(axis=0), np.array(SHORT.amplitudes) * limit, rtol=1e-2)
    quarter = round(23.0 / 4.0 * 250)
    assert path.q[quarter, 0] == pytest.approx(0.7 * limit[0], rel=1e-5)
    np.testing.assert_allclose(np.gradient(path.q, 4e-3, axis=0)[1:-1], path.qd[1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(path.qd, 4e-3, axis=0)[1:-1], path.qdd[1:-1], atol=1e-4)


def test_an_arm_with_crooked_ranges_swings_about_their_middle():
    panda = rigid_body_robot("panda")
    path = sine_path(panda.tree, committed(SineParameters, "arm_motion"))
    assert (path.q > panda.tree.lower).all()
    assert (path.q < panda.tree.upper).all()
    np.testing.assert_allclose(path.q[0], 0.5 * (panda.tree.lower + panda.tree.upper))


def test_the_right_model_tracks_without_help_of_the_feedback(robot, feedback):
    reference = sine_path(robot.tree, SHORT)
    model = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    with Arm(robot.tree, ideal(robot.inertias), 1.0 / SHORT.rate_hz) as arm:
        arm.place(reference.q[0], reference.qd[0])
        policy = sine_policy(model, reference, feedback)
        moved = run(arm, robot.tree, policy, len(reference.q), robot.model.effortLimit)
    assert moved.stopped is None
    assert nmse(moved.q, reference.q).max() < 1e-6
    correction = feedback.stiffness * (reference.q - moved.q)
    assert np.abs(correction).max() < 1e-2 * np.abs(moved.torques).max()


@pytest.mark.parametrize(
    ("torque", "reason"), [(np.nan, "not finite"), (np.inf, "not finite"), (250.0, "speed limit")]
)
def test_an_arm_that_runs_away_is_stopped(robot, torque, reason):
    with Arm(robot.tree, ideal(robot.inertias), 4e-3) as arm:
        arm.place(np.zeros(7), np.zeros(7))
        moved = run(arm, robot.tree, lambda k, q, qd: np.full(7, torque), 1000, robot.model.effortLimit)
    assert moved.stopped == reason
    assert len(moved.q) == len(moved.torques) < 1000
    assert np.isfinite(moved.q).all()


def test_an_arm_beyond_its_range_is_stopped(robot):
    with Arm(robot.tree, ideal(robot.inertias), 4e-3) as arm:
        arm.place(robot.tree.upper + 0.1, np.zeros(7))
        moved = run(arm, robot.tree, lambda k, q, qd: np.zeros(7), 10, robot.model.effortLimit)
    assert moved.stopped == "joint limit"


def test_torques_are_cut_off_at_the_drives_limits(robot):
    with Arm(robot.tree, ideal(robot.inertias), 4e-3) as arm:
        arm.place(np.zeros(7), np.zeros(7))
        moved = run(arm, robot.tree, lambda k, q, qd: np.full(7, -9.0), 1, np.full(7, 2.0))
    np.testing.assert_array_equal(moved.torques, np.full((1, 7), -2.0))


def test_too_few_periods_and_too_fast_sines_are_named(robot):
    with pytest.raises(InputError, match="periods_s: has 2 values, the arm has 7 joints"):
        sine_path(robot.tree, committed(SineParameters, "arm_motion", periods_s=(1.0, 2.0)))
    fast = (0.5, 19.0, 17.0, 13.0, 11.0, 7.0, 5.0)
    with pytest.raises(InputError, match=r"sine of joint 'lbr_iiwa_joint_1' reaches .* its limit is 10"):
        sine_path(robot.tree, committed(SineParameters, "arm_motion", periods_s=fast))


def test_feedback_is_damped_by_the_ratio(robot, feedback):
    q = np.zeros(7)
    torques = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    last = (torques(q, q, np.eye(7)[6]) - torques(q, q, q))[6]
    assert feedback.damping[6] == pytest.approx(2 * 0.7 * np.sqrt(feedback.stiffness[6] * last))
