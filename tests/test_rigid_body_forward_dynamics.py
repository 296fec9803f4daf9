import numpy as np
import pinocchio
import pytest
import torch
from rigid_body_robots import ROBOTS, configuration, robot, states

from structlearn.rigid_body.forward_dynamics import forward_dynamics, mass_matrix
from structlearn.rigid_body.inertia_parameters import draw, link_inertias
from structlearn.rigid_body.newton_euler import inverse_dynamics


@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_with_pinocchio(name):
    arm = robot(name)
    q, qd, torques = states(arm, 20)
    inertias = arm.inertias.tensors()
    inertia = mass_matrix(arm.tree, inertias, torch.tensor(q)).numpy()
    found = forward_dynamics(arm.tree, inertias, *(torch.tensor(values) for values in (q, qd, torques)))
    data = arm.model.createData()
    for sample, row in enumerate(q):
        row = configuration(arm, row)
        expected = pinocchio.crba(arm.model, data, row)
        expected = np.triu(expected) + np.triu(expected, 1).T
        np.testing.assert_allclose(inertia[sample], expected, rtol=0, atol=1e-12)
        expected = pinocchio.aba(arm.model, data, row, qd[sample], torques[sample])
        np.testing.assert_allclose(found[sample].numpy(), expected, rtol=1e-8, atol=1e-8)


def test_inverts_the_inverse_dynamics_of_every_model():
    """Also with nostr's non-symmetric inertias, whose mass matrix is not symmetric either."""
    arm = robot("odd")
    q, qd, qdd = (torch.tensor(values) for values in states(arm, 4))
    free = draw("nostr", len(arm.tree.names), [torch.Generator().manual_seed(seed) for seed in range(2)])
    free[..., 0] = 1.0 + free[..., 0].abs()
    inertias = link_inertias("nostr", free)
    torques = inverse_dynamics(arm.tree, inertias, q, qd, qdd)
    found = forward_dynamics(arm.tree, inertias, q, qd, torques)
    assert found.shape == (2, 4, len(arm.tree.names))
    torch.testing.assert_close(found, qdd.expand_as(found), rtol=1e-7, atol=1e-7)
    inertia = mass_matrix(arm.tree, inertias, q)
    assert (inertia - inertia.mT).abs().max() > 1e-3


@pytest.mark.parametrize("structure", ["tri", "cov"])
def test_consistent_models_have_positive_definite_mass_matrices(structure):
    arm = robot("odd")
    q = torch.tensor(states(arm, 10)[0])
    generators = [torch.Generator().manual_seed(seed) for seed in range(10)]
    inertias = link_inertias(structure, draw(structure, len(arm.tree.names), generators))
    assert torch.linalg.eigvalsh(mass_matrix(arm.tree, inertias, q)).min() > 0.0
