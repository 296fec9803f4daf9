import numpy as np
import pinocchio
import pytest
from rigid_body_robots import robot as known_robot

from structlearn.rigid_body import compiled_chain
from structlearn.rigid_body.operational_space_velocity import VelocityControl, joint_reference, tool_motion

TOOL = np.array([0.02, -0.03, 0.1])
GAIN = 6.0


@pytest.fixture(scope="module")
def robot():
    return known_robot("iiwa")


@pytest.fixture(scope="module")
def state():
    rng = np.random.default_rng(2)
    return np.array([0, 0.5, 0, -1.2, 0, 1, 0]) + rng.uniform(-1.0, 1.0, 7), rng.normal(size=7)


def pinocchio_tool(robot, q, qd, qdd):
    """Position, velocity and acceleration of the tool by Pinocchio."""
    model = robot.model.copy()
    frame = pinocchio.Frame("tool", 7, 0, pinocchio.SE3(np.eye(3), TOOL), pinocchio.FrameType.OP_FRAME)
    place = model.addFrame(frame)
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q, qd, qdd)
    pinocchio.updateFramePlacements(model, data)
    aligned = pinocchio.LOCAL_WORLD_ALIGNED
    return (
        data.oMf[place].translation.copy(),
        pinocchio.getFrameVelocity(model, data, place, aligned).linear,
        pinocchio.getFrameClassicalAcceleration(model, data, place, aligned).linear,
    )


def reference(robot, posture, q, qd, wanted):
    """Joint velocity and acceleration by the law."""
    body, work = compiled_chain.body(robot.tree, robot.inertias), compiled_chain.workspace(7)
    compiled_chain.dynamics(body, q, qd, work)
    return joint_reference(VelocityControl(TOOL, posture, GAIN, 2.0), body, work, q, qd, *wanted)


def test_tool_moves_as_in_pinocchio(robot, state):
    q, qd = state
    position, velocity = tool_motion(robot.tree, TOOL, q[None], qd[None])
    expected = pinocchio_tool(robot, q, qd, np.zeros(7))
    np.testing.assert_allclose(position[0], expected[0], atol=1e-12)
    np.testing.assert_allclose(velocity[0], expected[1], atol=1e-12)


def test_tool_gets_the_velocity_and_acceleration_that_the_law_asks_for(robot, state):
    q, qd = state
    x, xd, _ = pinocchio_tool(robot, q, qd, np.zeros(7))
    error, slow, wanted = np.array([[0.01, 0.02, -0.01], [0.1, 0.0, -0.2], [1.0, -1.0, 0.5]])
    velocity, qdd = reference(robot, q + 0.3, q, qd, (x + error, xd + slow, wanted))
    reached = pinocchio_tool(robot, q, velocity, np.zeros(7))[1]
    np.testing.assert_allclose(reached, xd + slow + GAIN * error, atol=1e-4)  # but for the inverse's damping
    _, _, acceleration = pinocchio_tool(robot, q, qd, qdd)
    np.testing.assert_allclose(acceleration, wanted + GAIN * slow, atol=1e-3)


def test_posture_does_not_move_the_tool(robot, state):
    q, qd = state
    wanted = pinocchio_tool(robot, q, qd, np.zeros(7))
    here, there = (reference(robot, posture, q, qd, wanted)[0] for posture in (q, q + 0.5))
    assert np.abs(there - here).max() > 0.1
    moved = pinocchio_tool(robot, q, there - here, np.zeros(7))[1]
    assert np.abs(moved).max() < 1e-4  # the damping of the pseudo-inverse
