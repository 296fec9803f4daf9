"""A robot written as a URDF is the same robot to Pinocchio and to PyBullet."""

from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import pytest
import torch
from rigid_body_robots import FILES, ODD, pinocchio_torques, states
from rigid_body_robots import robot as known_robot

from structlearn.core.errors import InputError
from structlearn.rigid_body.dynamics_models import rigid_body_torques
from structlearn.rigid_body.inertia_parameters import draw, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import Robot, read_urdf
from structlearn.rigid_body.urdf import write_urdf


def source(name: str, folder: Path) -> Path:
    if name != "odd":
        return Path(pybullet_data.getDataPath()) / FILES[name]
    path = folder / "source.urdf"
    path.write_text(ODD)
    return path


def other_inertias(robot: Robot):
    """Physically consistent inertias that are not those of the source."""
    free = draw("cov", len(robot.tree.names), [torch.Generator().manual_seed(3)])
    return link_inertias("cov", free[0]).arrays()


@pytest.mark.parametrize("name", ["iiwa", "panda", "xarm", "odd"])
def test_torques_of_what_was_written_are_those_of_what_was_identified(name, tmp_path):
    robot, target = known_robot(name), tmp_path / "identified.urdf"
    inertias = other_inertias(robot)
    write_urdf(source(name, tmp_path), target, robot.tree, inertias)
    back = read_urdf(target)
    assert back.tree.names == robot.tree.names
    q, qd, qdd = states(robot, 20)
    expected = rigid_body_torques(robot.tree, inertias, Motion(q, qd, qdd, q))
    np.testing.assert_allclose(pinocchio_torques(back, q, qd, qdd), expected, rtol=0, atol=1e-10)


@pytest.fixture
def engine():
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    yield client
    pybullet.disconnect(client)


@pytest.mark.parametrize("name", ["panda", "xarm"])
def test_pybullet_has_the_same_torques_and_the_friction(name, tmp_path, engine):
    robot, target = known_robot(name), tmp_path / "identified.urdf"
    joints, inertias = len(robot.tree.names), other_inertias(robot)
    viscous, coulomb = 0.1 + np.arange(joints), 0.5 * np.arange(joints)
    write_urdf(source(name, tmp_path), target, robot.tree, inertias, viscous, coulomb)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(str(target), useFixedBase=True, flags=flags, physicsClientId=engine)
    numbers = range(pybullet.getNumJoints(body, engine))
    found = [pybullet.getJointInfo(body, joint, engine) for joint in numbers]
    moving = [one for one in found if one[2] != pybullet.JOINT_FIXED]
    assert [one[1].decode() for one in moving] == list(robot.tree.names)
    np.testing.assert_allclose([one[6:8] for one in moving], np.stack([viscous, coulomb], axis=1))
    q, qd, qdd = states(robot, 5)
    expected = rigid_body_torques(robot.tree, inertias, Motion(q, qd, qdd, q))
    for row, its in enumerate(expected):
        rows = [values[row].tolist() for values in (q, qd, qdd)]
        torques = pybullet.calculateInverseDynamics(body, *rows, physicsClientId=engine)
        np.testing.assert_allclose(torques, its, rtol=1e-5, atol=1e-4 * np.abs(expected).max())


def test_another_robots_source_is_refused(tmp_path):
    robot = known_robot("iiwa")
    with pytest.raises(InputError, match="lacks the joints lbr_iiwa_joint_1"):
        write_urdf(source("panda", tmp_path), tmp_path / "a.urdf", robot.tree, robot.inertias)
