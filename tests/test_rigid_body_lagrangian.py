"""The fast form against automatic differentiation of the energy itself."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.autograd.functional import hessian, jacobian

from structlearn.networks.torch_settings import seeded
from structlearn.rigid_body.network_models import StackedLagrangianNetworks

JOINTS = 4


def networks(seeds=(0, 1)) -> StackedLagrangianNetworks:
    drawn = StackedLagrangianNetworks.initial(JOINTS, (8, 16, 8), [seeded(seed) for seed in seeds])
    arrays = {name: values.double() for name, values in drawn.to_arrays().items()}
    return StackedLagrangianNetworks.from_arrays(arrays)


def test_torques_are_those_of_the_lagrangian():
    own = networks()
    q, qd, qdd = torch.randn(3, JOINTS, 5, dtype=torch.float64, generator=seeded(3))
    torques = own.torques(q, qd, qdd)
    for model in range(2):
        for sample in range(5):
            state = q[:, sample], qd[:, sample], qdd[:, sample]

            def lagrangian(position, velocity, model=model):
                inertia = own.inertia_matrix(position[:, None])[model, 0]
                return 0.5 * velocity @ inertia @ velocity - own.potential_energy(position[:, None])[model, 0]

            # Euler-Lagrange: d/dt dL/dqd - dL/dq
            second = hessian(lagrangian, state[:2])
            slope = jacobian(lagrangian, state[:2])[0]
            expected = second[1][1] @ state[2] + second[1][0] @ state[1] - slope
            torch.testing.assert_close(torques[model, :, sample], expected, rtol=1e-10, atol=1e-12)


@given(st.integers(0, 10_000), st.floats(0.1, 30.0))
def test_the_inertia_matrix_is_positive_definite_whatever_the_weights(seed, scale):
    own = networks((seed,))
    with torch.no_grad():
        for weights in own.parameters():
            weights.mul_(scale)
    matrix = own.inertia_matrix(torch.randn(JOINTS, 20, dtype=torch.float64, generator=seeded(seed)))
    torch.testing.assert_close(matrix, matrix.mT, rtol=0, atol=1e-12 * float(matrix.detach().abs().max()))
    # rounding of an eigenvalue is relative to the largest one
    values = torch.linalg.eigvalsh(matrix).detach().numpy()
    assert (values > -1e-12 * np.abs(values).max(axis=-1, keepdims=True)).all()


def test_a_model_is_the_same_alone_and_in_a_stack():
    states = torch.randn(3, JOINTS, 5, dtype=torch.float64, generator=seeded(3))
    torch.testing.assert_close(
        networks().torques(*states)[1:], networks((1,)).torques(*states), rtol=1e-12, atol=1e-12
    )
