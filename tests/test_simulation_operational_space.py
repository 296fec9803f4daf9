"""Operational-space control: what its torques do to the hand, by Pinocchio's forward dynamics."""

import numpy as np
import pinocchio
import pytest
from scraping_motions import FLAT, beside_contact

from dissertation.scraping.world import scraping_robot
from dissertation.scraping.world.operational_space import Target, control, controlled, observe

ARM = scraping_robot.arm()
EDGE = ARM.model.getFrameId("edge")
LOCAL_WORLD = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
STIFFNESS = 900.0
NOTHING = np.zeros(6)


def hand_acceleration(q, v, torques, force=NOTHING):
    """J qdd of the edge frame under torques and a wrench on it, base frame."""
    jacobian = edge_jacobian(q)
    return jacobian @ pinocchio.aba(ARM.model, ARM.model.createData(), q, v, torques + jacobian.T @ force)


def edge_jacobian(q):
    return pinocchio.computeFrameJacobian(ARM.model, ARM.model.createData(), q, EDGE, LOCAL_WORLD)


def observed(q, v, posture=scraping_robot.HOME):
    arm = controlled(ARM, posture)
    observe(arm, q, v)
    return arm


def torques_of(arm, position, rotation, twist, acceleration, stiffness, force):
    """Torques towards a target; the state is observed anew, since the mass matrix is used up."""
    observe(arm, arm.q.copy(), arm.v.copy())
    target = Target(*(np.array(values, dtype=float) for values in (position, rotation, twist, acceleration)))
    control(arm, target, stiffness, force)
    return arm.torques.copy()


@pytest.fixture(params=range(4))
def state(request):
    rng = np.random.default_rng(request.param)
    return rng, scraping_robot.HOME + rng.uniform(-0.4, 0.4, 7), rng.normal(0.0, 0.2, 7)


def random_reference(rng, arm):
    turn = rng.normal(0.0, 0.3, 3)
    return (
        arm.position + rng.normal(0.0, 0.05, 3),
        pinocchio.exp3(turn) @ arm.rotation,
        rng.normal(0.0, 0.2, 6),
        rng.normal(0.0, 1.0, 6),
        turn,
    )


def test_what_is_observed_is_the_edge_frame(state):
    _, q, v = state
    arm = observed(q, v)
    data = ARM.model.createData()
    pinocchio.forwardKinematics(ARM.model, data, q, v)
    pinocchio.updateFramePlacements(ARM.model, data)
    np.testing.assert_allclose(arm.position, data.oMf[EDGE].translation, atol=1e-14)
    np.testing.assert_allclose(arm.rotation, data.oMf[EDGE].rotation, atol=1e-14)
    velocity = pinocchio.getFrameVelocity(ARM.model, data, EDGE, LOCAL_WORLD).vector
    np.testing.assert_allclose(arm.twist, velocity, atol=1e-14)


def test_the_hand_is_a_damped_unit_mass(state):
    """J qdd = K e + 2 sqrt(K) (v_d - v) + a_d."""
    rng, q, v = state
    arm = observed(q, v)
    position, rotation, twist, acceleration, turn = random_reference(rng, arm)
    torques = torques_of(arm, position, rotation, twist, acceleration, STIFFNESS, NOTHING)
    error = np.concatenate([position - arm.position, turn])
    wanted = STIFFNESS * error + 2 * np.sqrt(STIFFNESS) * (twist - arm.twist) + acceleration
    np.testing.assert_allclose(hand_acceleration(q, v, torques), wanted, atol=1e-8)


def test_the_elbow_moves_without_the_hand(state):
    rng, q, v = state
    one, other = observed(q, v), observed(q, v, posture=scraping_robot.HOME + rng.normal(0.0, 0.5, 7))
    reference = (*random_reference(rng, one)[:4], STIFFNESS, NOTHING)
    torques, others = torques_of(one, *reference), torques_of(other, *reference)
    assert np.abs(torques - others).max() > 0.1
    moves = hand_acceleration(q, v, torques) - hand_acceleration(q, v, others)
    np.testing.assert_allclose(moves, 0.0, atol=1e-8)


def test_an_additional_force_is_put_on_by_the_joints(state):
    """tau grows by J^T f, which a wrench of -f at the edge would undo."""
    rng, q, v = state
    arm = observed(q, v)
    reference, force = random_reference(rng, arm)[:4], rng.normal(0.0, 2.0, 6)
    without = torques_of(arm, *reference, STIFFNESS, NOTHING)
    with_it = torques_of(arm, *reference, STIFFNESS, force)
    np.testing.assert_allclose(with_it - without, edge_jacobian(q).T @ force, atol=1e-12)
    undone = hand_acceleration(q, v, with_it, force=-force)
    np.testing.assert_allclose(undone, hand_acceleration(q, v, without), atol=1e-8)


def test_the_error_of_a_turn_is_its_rotation_vector_up_to_nearly_half_a_turn():
    arm = observed(scraping_robot.HOME, np.zeros(7))
    still = (NOTHING, NOTHING, STIFFNESS, NOTHING)
    ahead = torques_of(arm, arm.position, arm.rotation, *still)
    for angle in (1e-10, 1e-3, 1.0, 3.0):
        axis = np.array([0.6, 0.0, -0.8])
        torques = torques_of(arm, arm.position, pinocchio.exp3(angle * axis) @ arm.rotation, *still)
        turned = hand_acceleration(scraping_robot.HOME, np.zeros(7), torques) - hand_acceleration(
            scraping_robot.HOME, np.zeros(7), ahead
        )
        np.testing.assert_allclose(turned[3:], STIFFNESS * angle * axis, rtol=1e-6, atol=1e-8)


def test_the_controller_knows_the_arm_with_an_unloaded_tool():
    """In a rigid grasp: masses of the whole robot, and the edge below the hand."""
    whole, count = scraping_robot.whole().model, scraping_robot.ARM_JOINTS
    data, own = whole.createData(), ARM.model.createData()
    q = np.random.default_rng(0).uniform(-1.5, 1.5, count)
    rigid = np.concatenate([q, np.zeros(whole.nq - count)])
    mass = pinocchio.crba(whole, data, rigid)[:count, :count]
    np.testing.assert_allclose(np.triu(pinocchio.crba(ARM.model, own, q)), np.triu(mass))
    pinocchio.framesForwardKinematics(whole, data, rigid)
    arm, hand = observed(q, np.zeros(count)), data.oMf[whole.getFrameId("hand")]
    np.testing.assert_allclose(arm.rotation, hand.rotation, atol=1e-12)
    below = [0, 0, scraping_robot.GRASP_M + scraping_robot.EDGE_M]
    np.testing.assert_allclose(hand.actInv(arm.position), below, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, 0.087])
@pytest.mark.parametrize("forward", [0.0, 0.064])
@pytest.mark.parametrize("tilt_deg", [(0, 0, 0), (5, -15, 0), (-5, 15, 5)])
def test_joint_angles_reach_all_poses_of_the_task(height, forward, tilt_deg):
    """8.7 cm above the board to 6.4 cm along it, tilted by up to 15 degrees either way."""
    rotation, position = pinocchio.exp3(np.radians(tilt_deg)) @ FLAT, beside_contact(height, forward)
    arm = observed(scraping_robot.joint_angles(position, rotation), np.zeros(7))
    np.testing.assert_allclose(arm.position, position, atol=1e-11)
    np.testing.assert_allclose(arm.rotation, rotation, atol=1e-11)
    assert np.abs(arm.q - scraping_robot.HOME).max() < 0.8  # the same elbow


def test_out_of_reach():
    with pytest.raises(ValueError, match="the arm does not reach"):
        scraping_robot.joint_angles(np.array([2.0, 0.0, 0.5]), FLAT)
