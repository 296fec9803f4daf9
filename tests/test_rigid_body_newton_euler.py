import numpy as np
import pytest
import torch
from rigid_body_robots import ROBOTS, pendulum, pinocchio_torques, robot, states

from structlearn.rigid_body.inertia_parameters import STRUCTURES, draw, link_inertias
from structlearn.rigid_body.newton_euler import inverse_dynamics
from structlearn.rigid_body.tree import LinkInertias


def as_tensors(*arrays):
    return [torch.tensor(array) for array in arrays]


@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_with_pinocchio(name):
    arm = robot(name)
    motion = states(arm, 50)
    torques = inverse_dynamics(arm.tree, arm.inertias.tensors(), *as_tensors(*motion))
    expected = pinocchio_torques(arm, *motion)
    assert np.abs(expected).max() > 1.0
    assert np.abs(torques.numpy() - expected).max() < 1e-9


def test_leading_axes_are_models():
    arm = robot("odd")
    motion = as_tensors(*states(arm, 4))
    generators = [torch.Generator().manual_seed(seed) for seed in range(3)]
    inertias = link_inertias("cov", draw("cov", len(arm.tree.names), generators))
    torques = inverse_dynamics(arm.tree, inertias, *motion)
    assert torques.shape == (3, 4, len(arm.tree.names))
    for model in range(3):
        one = LinkInertias(inertias.mass[model], inertias.first_moment[model], inertias.inertia[model])
        torch.testing.assert_close(inverse_dynamics(arm.tree, one, *motion), torques[model])


def test_a_pendulum_in_closed_form():
    mass, length, moment = 1.3, 0.4, 0.02
    tree, inertias = pendulum(mass, length, moment)
    q, qd, qdd = as_tensors(np.array([[0.7]]), np.array([[2.0]]), np.array([[3.0]]))
    expected = (moment + mass * length**2) * 3.0 + mass * 9.81 * length * np.sin(0.7)
    torque = inverse_dynamics(tree, inertias.tensors(), q, qd, qdd)
    assert torque.item() == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_gradients_to_parameters_are_finite_differences(structure):
    arm = robot("odd")
    motion = as_tensors(*states(arm, 3))
    free = draw(structure, len(arm.tree.names), [torch.Generator().manual_seed(4)])[0]
    free[:, 0] += 2.0 * torch.sign(free[:, 0])  # away from massless links, where h / m is steep
    free.requires_grad_()

    def torques(values):
        return inverse_dynamics(arm.tree, link_inertias(structure, values), *motion)

    assert torch.autograd.gradcheck(torques, free, eps=1e-6, atol=1e-5)


def test_gradients_to_states_are_finite_differences():
    arm = robot("odd")
    motion = [values.requires_grad_() for values in as_tensors(*states(arm, 2))]
    inertias = arm.inertias.tensors()
    assert torch.autograd.gradcheck(
        lambda *state: inverse_dynamics(arm.tree, inertias, *state), motion, atol=1e-5
    )


def test_an_inertia_need_not_be_symmetric():
    """The last link alone spins about z: n = I dw + w x (I w), so Izx and Ixz do not act alike."""
    arm = robot("iiwa")
    inertias, motion = arm.inertias.tensors(), as_tensors(*states(arm, 5))
    extra = torch.zeros(7, 3, 3, dtype=torch.float64)
    extra[6, 2, 0] = 0.5  # with its mirror image zero

    def change(tensor):
        odd = LinkInertias(inertias.mass, inertias.first_moment, inertias.inertia + tensor)
        return inverse_dynamics(arm.tree, odd, *motion) - inverse_dynamics(arm.tree, inertias, *motion)

    assert (change(extra) - change(extra.mT)).abs().max() > 1e-2
    torch.testing.assert_close(change(extra) + change(extra.mT), change(extra + extra.mT))
