import numpy as np
import pinocchio
import pybullet_data
import pytest
import torch

from structlearn.rigid_body import compiled_dynamics, newton_euler
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.inertia_parameters import STRUCTURES, draw, link_inertias
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, read_urdf

ARMS = {
    "kuka_iiwa/model.urdf": (),
    "franka_panda/panda.urdf": (),  # its fingers slide
    "xarm/xarm6_robot.urdf": (),
}


@pytest.fixture(scope="module", params=ARMS)
def robot(request):
    return read_urdf(f"{pybullet_data.getDataPath()}/{request.param}", ARMS[request.param])


def states(count: int, joints: int) -> np.ndarray:
    return np.random.default_rng(3).normal(size=(count, 3, joints)) * [[1.0], [2.0], [5.0]]


def test_torques_are_those_of_pinocchio(robot):
    torques = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    data = robot.model.createData()
    for q, qd, qdd in states(20, len(robot.tree.names)):
        expected = pinocchio.rnea(robot.model, data, q, qd, qdd)
        np.testing.assert_allclose(torques(q, qd, qdd), expected, atol=1e-9 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("structure", STRUCTURES)
def test_torques_of_learned_inertias_are_those_of_the_recursion_that_is_trained(robot, structure):
    count = len(robot.tree.names)
    free = draw(structure, count, [torch.Generator().manual_seed(1)])[0]
    inertias = link_inertias(structure, free)
    torques = compiled_dynamics.inverse_dynamics(robot.tree, inertias.arrays())
    q, qd, qdd = states(10, count).transpose(1, 0, 2)
    expected = newton_euler.inverse_dynamics(
        robot.tree, inertias.tensors(), *(torch.tensor(values) for values in (q, qd, qdd))
    ).numpy()
    found = np.array([torques(*state) for state in zip(q, qd, qdd, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_friction_is_added_joint_by_joint(robot):
    count = len(robot.tree.names)
    coefficients = np.random.default_rng(0).uniform(0.1, 1.0, (count, 2))
    rows = compiled_dynamics.friction_rows(coefficients, ("viscous", "coulomb"))
    smooth = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias)
    rubbing = compiled_dynamics.inverse_dynamics(robot.tree, robot.inertias, rows)
    q, qd, qdd = states(1, count)[0]
    expected = (friction_columns(qd, ("viscous", "coulomb")) * coefficients).sum(axis=-1)
    np.testing.assert_allclose(rubbing(q, qd, qdd) - smooth(q, qd, qdd), expected, atol=1e-9)
    assert (rows[2] == 0).all()


def test_a_pendulum_has_its_closed_form():
    mass, length, own = 2.0, 0.3, 0.01
    tree = KinematicTree(
        ("hinge",),
        np.array([-1]),
        np.eye(3)[None],
        np.zeros((1, 3)),
        np.array([[0.0, 1.0, 0.0]]),
        np.array([False]),
        np.array([-3.0]),
        np.array([3.0]),
        np.array([9.0]),
        np.array([0.0, 0.0, -9.81]),
    )
    body = LinkInertias(
        np.array([mass]), np.array([[0.0, 0.0, -mass * length]]), np.diag([own, own, own])[None]
    )
    torque = compiled_dynamics.inverse_dynamics(tree, body)(np.array([0.4]), np.array([1.5]), np.array([2.0]))
    expected = (mass * length**2 + own) * 2.0 + mass * 9.81 * length * np.sin(0.4)
    assert torque[0] == pytest.approx(expected, abs=1e-12)
