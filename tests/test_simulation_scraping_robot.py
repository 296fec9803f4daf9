"""The robot as PyBullet and Pinocchio see it: one robot."""

import numpy as np
import pinocchio
import pytest
from scraping_motions import FLAT, beside_contact

from structlearn.simulation.bullet_arm import BulletArm
from structlearn.testbeds.scraping.world.scraping_robot import (
    ARM_JOINTS,
    EDGE_M,
    GRASP_JOINTS,
    GRASP_M,
    HOME,
    arm_model,
    joint_angles,
    urdf,
)
from structlearn.testbeds.scraping.world.scraping_robot import whole as whole_robot

JOINTS = ARM_JOINTS + len(GRASP_JOINTS)
GRAVITY = np.array([0.0, 0.0, -9.81])
DT = 1e-5  # s


@pytest.fixture(scope="module")
def whole():
    model = pinocchio.buildModelFromXML(urdf())
    model.gravity.linear = GRAVITY
    return model


@pytest.fixture(scope="module")
def loaded():
    """The robot in PyBullet."""
    robot = whole_robot()
    with BulletArm(robot.tree, robot.inertias, np.zeros(JOINTS), DT) as arm:
        yield arm


def states(count=8):
    """Joint positions, velocities and accelerations anywhere in the arm's reach, the grasp loaded."""
    rng = np.random.default_rng(0)
    scale = np.repeat([1.0, 0.003, 0.2], [ARM_JOINTS, 3, 3])
    for _ in range(count):
        yield tuple(scale * rng.uniform(-1.5, 1.5, JOINTS) for _ in range(3))


def test_the_controller_knows_the_arm_with_an_unloaded_tool(whole):
    arm, data = arm_model(), whole.createData()
    assert arm.model.nq == ARM_JOINTS
    for q, _, _ in states(3):
        rigid = np.concatenate([q[:ARM_JOINTS], np.zeros(6)])
        mass = pinocchio.crba(whole, data, rigid)[:ARM_JOINTS, :ARM_JOINTS]
        own = arm.model.createData()
        np.testing.assert_allclose(np.triu(pinocchio.crba(arm.model, own, q[:ARM_JOINTS])), np.triu(mass))
        pinocchio.framesForwardKinematics(whole, data, rigid)
        pinocchio.framesForwardKinematics(arm.model, own, q[:ARM_JOINTS])
        hand, edge = data.oMf[whole.getFrameId("hand")], own.oMf[arm.edge_frame]
        np.testing.assert_allclose(edge.rotation, hand.rotation, atol=1e-12)
        np.testing.assert_allclose(hand.actInv(edge).translation, [0, 0, GRASP_M + EDGE_M], atol=1e-12)


def pose_of(angles):
    arm = arm_model()
    data = arm.model.createData()
    pinocchio.framesForwardKinematics(arm.model, data, angles)
    return data.oMf[arm.edge_frame]


def test_joint_angles_reach_all_poses_of_the_task():
    """8.7 cm above the board to 6.4 cm along it, tilted by up to 15 degrees either way."""
    for height in (0.0, 0.087):
        for forward in (0.0, 0.064):
            for tilt in np.radians([[0, 0, 0], [5, -15, 0], [-5, 15, 5]]):
                goal = pinocchio.SE3(pinocchio.exp3(tilt) @ FLAT, beside_contact(height, forward))
                angles = joint_angles(goal.translation, goal.rotation)
                assert np.abs(pinocchio.log6(pose_of(angles).actInv(goal)).vector).max() < 1e-11
                assert np.abs(angles - HOME).max() < 0.8  # the same elbow


def test_out_of_reach():
    with pytest.raises(ValueError, match="the arm does not reach"):
        joint_angles(np.array([2.0, 0.0, 0.5]), FLAT)
