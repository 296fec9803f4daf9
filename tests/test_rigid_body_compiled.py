import numpy as np
import pytest
import torch
from rigid_body_robots import ROBOTS, pendulum, pinocchio_torques, robot, states

from structlearn.rigid_body import compiled_dynamics, newton_euler
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.inertia_parameters import STRUCTURES, draw, link_inertias


@pytest.fixture(scope="module", params=ROBOTS)
def arm(request):
    return robot(request.param)


def test_torques_are_those_of_pinocchio(arm):
    torques, motion = compiled_dynamics.inverse_dynamics(arm.tree, arm.inertias), states(arm, 20)
    expected = pinocchio_torques(arm, *motion)
    found = np.array([torques(*state) for state in zip(*motion, strict=True)])
    np.testing.assert_allclose(found, expected, atol=1e-9 * (1 + np.abs(expected).max()))


@pytest.mark.parametrize("structure", STRUCTURES)
def test_torques_of_learned_inertias_are_those_of_the_recursion_that_is_trained(structure, arm):
    free = draw(structure, len(arm.tree.names), [torch.Generator().manual_seed(1)])[0]
    inertias, motion = link_inertias(structure, free), states(arm, 10)
    torques = compiled_dynamics.inverse_dynamics(arm.tree, inertias.arrays())
    tensors = (torch.tensor(values) for values in motion)
    expected = newton_euler.inverse_dynamics(arm.tree, inertias.tensors(), *tensors).numpy()
    found = np.array([torques(*state) for state in zip(*motion, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_friction_is_added_joint_by_joint(arm):
    count = len(arm.tree.names)
    coefficients = np.random.default_rng(0).uniform(0.1, 1.0, (count, 2))
    rows = compiled_dynamics.friction_rows(coefficients, ("viscous", "coulomb"))
    smooth = compiled_dynamics.inverse_dynamics(arm.tree, arm.inertias)
    rubbing = compiled_dynamics.inverse_dynamics(arm.tree, arm.inertias, rows)
    q, qd, qdd = (values[0] for values in states(arm, 1))
    expected = (friction_columns(qd, ("viscous", "coulomb")) * coefficients).sum(axis=-1)
    np.testing.assert_allclose(rubbing(q, qd, qdd) - smooth(q, qd, qdd), expected, atol=1e-9)
    assert (rows[2] == 0).all()


def test_a_pendulum_has_its_closed_form():
    mass, length, own = 2.0, 0.3, 0.01
    state = np.array([0.4]), np.array([1.5]), np.array([2.0])
    torque = compiled_dynamics.inverse_dynamics(*pendulum(mass, length, own))(*state)
    expected = (mass * length**2 + own) * 2.0 + mass * 9.81 * length * np.sin(0.4)
    assert torque[0] == pytest.approx(expected, abs=1e-12)
