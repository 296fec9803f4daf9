import numpy as np
import pytest
import torch
from rigid_body_robots import ROBOTS, pinocchio_torques, robot, states

from structlearn.ground.metrics import nmse
from structlearn.rigid_body.inertia_parameters import STRUCTURES, draw, link_inertias
from structlearn.rigid_body.newton_euler import inverse_dynamics
from structlearn.rigid_body.regressor import link_parameters, torque_factors, torque_regressor


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("symmetric", [True, False])
def test_agrees_with_pinocchio(name, symmetric):
    arm = robot(name)
    motion = states(arm, 50)
    parameters = link_parameters(arm.inertias.tensors(), symmetric).numpy()
    torques = torque_regressor(arm.tree, *motion, symmetric) @ parameters
    assert np.abs(torques - pinocchio_torques(arm, *motion)).max() < 1e-9


@pytest.mark.parametrize("name", ["iiwa", "odd"])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_agrees_with_the_recursion_for_any_parameters(name, structure):
    """Also where an inertia is not symmetric or no body has it; three models at once."""
    arm = robot(name)
    motion = states(arm, 20)
    generators = [torch.Generator().manual_seed(seed) for seed in range(3)]
    inertias = link_inertias(structure, draw(structure, len(arm.tree.names), generators))
    symmetric = structure != "nostr"
    regressor = torch.from_numpy(torque_regressor(arm.tree, *motion, symmetric))
    torques = torch.einsum("bnp,mp->mbn", regressor, link_parameters(inertias, symmetric))
    recursive = inverse_dynamics(arm.tree, inertias, *(torch.tensor(values) for values in motion))
    scale = recursive.abs().max().clamp(min=1.0)  # nostr's h / m can be huge
    assert (torques - recursive).abs().max() < 1e-9 * scale


@pytest.mark.parametrize("structure", STRUCTURES)
def test_both_paths_have_the_same_gradient(structure):
    arm = robot("odd")
    motion = states(arm, 10)
    symmetric = structure != "nostr"
    free = draw(structure, len(arm.tree.names), [torch.Generator().manual_seed(3)]).requires_grad_()
    regressor = torch.from_numpy(torque_regressor(arm.tree, *motion, symmetric))
    product = regressor @ link_parameters(link_inertias(structure, free), symmetric)[0]
    recursive = inverse_dynamics(
        arm.tree, link_inertias(structure, free), *(torch.tensor(values) for values in motion)
    )
    (by_product,) = torch.autograd.grad(product.square().sum(), free)
    (by_recursion,) = torch.autograd.grad(recursive.square().sum(), free)
    torch.testing.assert_close(by_product, by_recursion, rtol=1e-9, atol=1e-9)


def test_a_link_acts_only_on_the_joints_that_carry_it():
    arm = robot("odd")
    tree = arm.tree
    joints = len(tree.names)
    regressor = torque_regressor(tree, *states(arm, 5)).reshape(5, joints, joints, 10)
    for link in range(joints):
        carriers, joint = set(), link
        while joint >= 0:
            carriers.add(joint)
            joint = tree.parents[joint]
        acting = set(np.flatnonzero(np.abs(regressor[:, :, link]).max(axis=(0, 2))))
        assert acting == carriers


def test_order_and_type_of_the_arrays_do_not_matter():
    arm = robot("iiwa")
    motion = states(arm, 5)
    turned = [np.asfortranarray(values) for values in motion]
    np.testing.assert_array_equal(torque_regressor(arm.tree, *turned), torque_regressor(arm.tree, *motion))
    assert torque_regressor(arm.tree, *(values[:0] for values in motion)).shape == (0, 7, 70)


def test_errors_are_those_of_the_data_set():
    rng = np.random.default_rng(0)
    regressor = rng.normal(size=(200, 3, 5))
    regressor[:, 1, :2] = 0.0  # links before the joint
    torque = rng.normal(size=(200, 3))
    parameters = rng.normal(size=(4, 5))
    factors = torque_factors(regressor, torque)
    expected = [nmse(regressor @ values, torque) for values in parameters]
    np.testing.assert_allclose(factors.nmse(parameters), expected, rtol=1e-12)


def test_small_errors_beside_large_torques_keep_their_digits():
    rng = np.random.default_rng(0)
    regressor = rng.normal(size=(500, 1, 2)) * [1e3, 1e-3]
    true = np.array([1.0, 1.0])
    factors = torque_factors(regressor, regressor @ true)
    wrong = np.array([1.0, 1.0 + 1e-4])  # a torque error of 1e-7 on 1e3
    error = 1e-8 * (regressor[..., 1] ** 2).mean() / factors.variance[0]
    np.testing.assert_allclose(factors.nmse(wrong), [error], rtol=1e-4)


def test_fewer_samples_than_parameters():
    regressor = np.arange(6.0).reshape(2, 1, 3)
    factors = torque_factors(regressor, np.array([[1.0], [2.0]]))
    np.testing.assert_allclose(factors.nmse(np.zeros(3)), [2.5 / 0.25])
