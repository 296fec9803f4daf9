"""Three ways to the same torques: the recursion that gradients flow through, the regressor, compiled."""

import copy
import pickle

import numpy as np
import pinocchio
import pytest
import torch
from newton_euler import inverse_dynamics
from rigid_body_robots import ROBOTS, pendulum, pinocchio_torques, robot, states

from dissertation.dynamics.protocol.truth import agreement_with_pinocchio
from dissertation.simulation import compiled_chain
from structlearn.core.metrics import nmse
from structlearn.rigid_body import compiled_dynamics, friction
from structlearn.rigid_body.inertia_parameters import STRUCTURES, link_inertias, sample_parameters
from structlearn.rigid_body.regressor import link_parameters, torque_factors, torque_regressor
from structlearn.rigid_body.robot import configuration
from structlearn.rigid_body.tree import LinkInertias, robot_arrays

TERMS = ("viscous", "coulomb", "offset", "stiffness")


def as_tensors(*arrays):
    return [torch.tensor(array) for array in arrays]


def one_by_one(torques, motion):
    return np.array([torques(*state) for state in zip(*motion, strict=True)])


@pytest.mark.parametrize("name", ROBOTS)
def test_all_ways_agree_with_pinocchio(name):
    arm = robot(name)
    motion, inertias = states(arm, 50), arm.inertias.tensors()
    expected = pinocchio_torques(arm, *motion)
    full = torque_regressor(arm.tree, *motion, False) @ link_parameters(inertias, False).numpy()
    assert np.abs(full - expected).max() < 1e-9
    found = agreement_with_pinocchio(arm)
    assert found.pop("largest_n_m") > 1.0
    assert max(found.values()) < 1e-9
    recursive = inverse_dynamics(arm.tree, inertias, *as_tensors(*motion)).numpy()
    assert np.abs(recursive - expected).max() < 1e-9


@pytest.mark.parametrize("name", ["iiwa", "odd"])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_all_ways_agree_for_any_parameters(name, structure):
    """Also where an inertia is not symmetric or no body has it; three models at once, and each alone."""
    arm = robot(name)
    motion = states(arm, 20)
    generators = [torch.Generator().manual_seed(seed) for seed in range(3)]
    inertias = link_inertias(structure, sample_parameters(structure, len(arm.tree.names), generators))
    recursive = inverse_dynamics(arm.tree, inertias, *as_tensors(*motion)).numpy()
    tolerance = 1e-9 * max(1.0, np.abs(recursive).max())  # nostr's h / m can be huge
    symmetric = structure != "nostr"
    regressor = torque_regressor(arm.tree, *motion, symmetric)
    theta = link_parameters(inertias, symmetric).numpy()
    np.testing.assert_allclose(np.moveaxis(regressor @ theta.T, -1, 0), recursive, rtol=0, atol=tolerance)
    for model in range(3):
        compiled = compiled_dynamics.inverse_dynamics(arm.tree, inertias.arrays().of(model))
        np.testing.assert_allclose(one_by_one(compiled, motion), recursive[model], rtol=0, atol=tolerance)


def test_a_pendulum_in_closed_form():
    mass, length, moment = 1.3, 0.4, 0.02
    tree, inertias = pendulum(mass, length, moment)
    state = np.array([[0.7]]), np.array([[2.0]]), np.array([[3.0]])
    expected = (moment + mass * length**2) * 3.0 + mass * 9.81 * length * np.sin(0.7)
    torque = inverse_dynamics(tree, inertias.tensors(), *as_tensors(*state))
    compiled = one_by_one(compiled_dynamics.inverse_dynamics(tree, inertias), state)
    assert (torque.item(), compiled.item()) == pytest.approx((expected, expected), abs=1e-12)


def test_friction_of_another_shape_is_refused():
    """Compiled functions would read past its end."""
    arm = robot("odd")
    with pytest.raises(ValueError, match=r"friction has the shape \(3, "):
        compiled_dynamics.inverse_dynamics(arm.tree, arm.inertias, np.zeros((3, len(arm.tree.names))))


@pytest.mark.parametrize("structure", STRUCTURES)
def test_gradients_to_parameters_are_finite_differences_and_those_through_the_regressor(structure):
    arm = robot("odd")
    motion = states(arm, 3)
    free = sample_parameters(structure, len(arm.tree.names), [torch.Generator().manual_seed(4)])[0]
    free[:, 0] += 2.0 * torch.sign(free[:, 0])  # away from massless links, where h / m is steep
    free.requires_grad_()

    def torques(values):
        return inverse_dynamics(arm.tree, link_inertias(structure, values), *as_tensors(*motion))

    assert torch.autograd.gradcheck(torques, free, eps=1e-6, atol=1e-5, fast_mode=True)
    symmetric = structure != "nostr"
    regressor = torch.from_numpy(torque_regressor(arm.tree, *motion, symmetric))
    product = regressor @ link_parameters(link_inertias(structure, free), symmetric)
    (by_product,) = torch.autograd.grad(product.square().sum(), free)
    (by_recursion,) = torch.autograd.grad(torques(free).square().sum(), free)
    torch.testing.assert_close(by_product, by_recursion, rtol=1e-9, atol=1e-9)


def test_errors_by_factors_are_those_of_the_data_set():
    rng = np.random.default_rng(0)
    regressor, torque, parameters = rng.normal(size=(200, 3, 5)), rng.normal(size=(200, 3)), np.eye(5)
    regressor[:, 1, :2] = 0.0  # links before the joint
    expected = [nmse(regressor @ values, torque) for values in parameters]
    np.testing.assert_allclose(torque_factors(regressor, torque).nmse(parameters), expected, rtol=1e-12)
    few = torque_factors(np.arange(6.0).reshape(2, 1, 3), np.array([[1.0], [2.0]]))
    np.testing.assert_allclose(few.nmse(np.zeros(3)), [2.5 / 0.25])


def test_small_errors_beside_large_torques_keep_their_digits():
    regressor = np.random.default_rng(0).normal(size=(500, 1, 2)) * [1e3, 1e-3]
    factors = torque_factors(regressor, regressor @ np.ones(2))
    wrong = np.array([1.0, 1.0 + 1e-4])  # a torque error of 1e-7 on 1e3
    error = 1e-8 * (regressor[..., 1] ** 2).mean() / factors.variance[0]
    np.testing.assert_allclose(factors.nmse(wrong), [error], rtol=1e-4)


def test_friction_in_closed_form_by_columns_regressor_and_compiled():
    qd = np.array([[0.5, -2.0], [0.0, friction.COULOMB_WIDTH]])
    q = np.array([[1.0, 2.0], [-1.0, 0.5]])
    coefficients = np.array([[0.3, 1.0, 0.1, 0.6], [0.2, 2.0, -0.4, -0.8]])
    expected = [
        [0.3 * 0.5 + 1.0 + 0.1 + 0.6, -0.2 * 2.0 - 2.0 - 0.4 - 1.6],
        [0.1 - 0.6, 0.2 * friction.COULOMB_WIDTH + 2.0 * np.tanh(1.0) - 0.4 - 0.4],
    ]
    for terms in (TERMS, TERMS[::-1]):
        ordered = coefficients[:, [TERMS.index(term) for term in terms]]
        by_column = (friction.friction_columns(q, qd, terms) * ordered).sum(axis=-1)
        np.testing.assert_allclose(by_column, expected, rtol=1e-12)
        np.testing.assert_allclose(
            friction.friction_regressor(q, qd, terms) @ ordered.ravel(), expected, rtol=1e-12
        )
        compiled = np.zeros((2, 2))
        for *state, torques in zip(q, qd, compiled, strict=True):
            compiled_dynamics.add_friction(compiled_dynamics.friction_rows(ordered, terms), *state, torques)
        np.testing.assert_allclose(compiled, expected, rtol=1e-12)


def test_friction_never_drives():
    """Viscous and Coulomb friction take power from the joint for any free parameters."""
    generator = np.random.default_rng(1)
    free = torch.from_numpy(generator.normal(0.0, 5.0, (3, 7, 2)))
    qd = generator.normal(size=(50, 7))
    coefficients = friction.friction_coefficients(free, TERMS[:2]).numpy()
    torque = np.einsum("bnk,mnk->mbn", friction.friction_columns(0.0 * qd, qd, TERMS[:2]), coefficients)
    assert (torque * qd >= 0.0).all()


@pytest.mark.parametrize("name", ["iiwa", "odd"])
def test_single_states_from_python(name):
    """Pinocchio's, whose results are kept by the caller; copies, also pickled ones, work on their own."""
    arm = robot(name)
    q, qd, qdd = states(arm, 5)
    expected = pinocchio_torques(arm, q, qd, qdd)
    torques = [arm.inverse_dynamics(*state) for state in zip(q, qd, qdd, strict=True)]
    np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-12)
    accelerations = [arm.forward_dynamics(*state) for state in zip(q, qd, expected, strict=True)]
    np.testing.assert_allclose(accelerations, qdd, rtol=1e-9, atol=1e-7)
    for twin in (pickle.loads(pickle.dumps(arm)), copy.deepcopy(arm)):
        np.testing.assert_array_equal(twin.inverse_dynamics(q[0], qd[0], qdd[0]), torques[0])


def test_a_model_called_from_python_gives_the_same_bits():
    arm, friction_terms = robot("iiwa"), np.random.default_rng(2).normal(size=(4, 7))
    motion = states(arm, 20)
    model = compiled_dynamics.inverse_dynamics(arm.tree, arm.inertias, friction_terms)
    expected, torques = one_by_one(model, motion), compiled_dynamics.from_python(model)
    del model  # the function keeps the arrays
    np.testing.assert_array_equal(one_by_one(torques, motion), expected)


DT = 1.0 / 900.0


@pytest.fixture(scope="module", params=ROBOTS)
def arm(request):
    return robot(request.param)


@pytest.fixture(scope="module")
def arrays(arm):
    return robot_arrays(arm.tree, arm.inertias)


@pytest.fixture
def work(arm):
    return compiled_chain.workspace(len(arm.tree.names))


def close(found, expected):
    np.testing.assert_allclose(found, expected, atol=1e-11 * (1 + np.abs(expected).max()))


def test_mass_matrix_bias_frames_twists_and_accelerations_are_those_of_pinocchio(arm, arrays, work):
    data = arm.model.createData()
    for q, qd, torques in zip(*states(arm, 20), strict=True):
        compiled_chain.dynamics(arrays, q, qd, work)
        placed = configuration(arm.model, q)
        mass = np.triu(pinocchio.crba(arm.model, data, placed))
        close(work.mass_matrix, mass + np.triu(mass, 1).T)
        close(work.bias, pinocchio.nonLinearEffects(arm.model, data, placed, qd))
        pinocchio.forwardKinematics(arm.model, data, placed, qd)
        for link in range(len(q)):
            close(work.frame[link], data.oMi[link + 1].rotation)
            close(work.place[link], data.oMi[link + 1].translation)
            twist = data.oMi[link + 1].act(data.v[link + 1])
            close(work.twist[link], np.concatenate([twist.angular, twist.linear]))
        expected = pinocchio.aba(arm.model, data, placed, qd, torques)
        found = torques.copy()
        compiled_chain.accelerations(work, found)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_a_step_leaves_the_workspace_of_the_new_state(arm, arrays, work):
    q, qd, torques = (values[0] for values in states(arm, 1))
    compiled_chain.dynamics(arrays, q, qd, work)
    compiled_chain.step(arrays, q, qd, torques.copy(), DT, work)
    again = compiled_chain.workspace(len(q))
    compiled_chain.dynamics(arrays, q, qd, again)
    np.testing.assert_array_equal(work.mass_matrix, again.mass_matrix)
    np.testing.assert_array_equal(work.bias, again.bias)


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
