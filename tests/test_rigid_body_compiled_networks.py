import numpy as np
import pytest
import torch

from structlearn.rigid_body import compiled_dynamics
from structlearn.rigid_body.compiled_models import Networks, lagrangian_torques, perceptron_torques
from structlearn.rigid_body.dynamics_models import lagrangian, perceptron
from structlearn.rigid_body.network_models import StackedLagrangianNetworks, StackedPerceptrons

JOINTS, MODELS, HIDDEN = 3, 2, (8, 16, 8)


@pytest.fixture(scope="module")
def states():
    return torch.tensor(np.random.default_rng(5).normal(size=(3, JOINTS, 12)), dtype=torch.float64)


def generators() -> list[torch.Generator]:
    return [torch.Generator().manual_seed(model) for model in range(MODELS)]


def stacked(kind):
    """Networks at their start, in double precision."""
    arrays = kind.initial(JOINTS, HIDDEN, generators()).to_arrays()
    return kind.from_arrays({name: values.double() for name, values in arrays.items()})


def one_by_one(torques, networks: Networks, states: torch.Tensor) -> np.ndarray:
    rows = np.ascontiguousarray(np.moveaxis(states.numpy(), -1, 0))
    return np.array([torques(networks, *state) for state in rows]).T


@pytest.mark.parametrize(
    ("kind", "compiled", "torques", "standardised"),
    [
        (StackedPerceptrons, perceptron, perceptron_torques, False),
        (StackedPerceptrons, perceptron, perceptron_torques, True),
        (StackedLagrangianNetworks, lagrangian, lagrangian_torques, False),
    ],
)
def test_a_network_gives_what_the_trained_batch_gives(states, kind, compiled, torques, standardised):
    networks = stacked(kind)
    if standardised:
        networks = networks.standardised((3.0 * states[0] + 1.0, states[1], states[2]), 7.0 * states[2] - 2.0)
    batch = networks.torques(*states).numpy()
    for model in range(MODELS):
        found = one_by_one(torques, compiled(networks, model), states)
        np.testing.assert_allclose(found, batch[model], atol=1e-12)


def test_friction_acts_beside_a_lagrangian_network(states):
    networks = stacked(StackedLagrangianNetworks)
    rows = compiled_dynamics.friction_rows(np.full((JOINTS, 1), 0.5), ("viscous",))
    without, rubbing = (
        one_by_one(lagrangian_torques, lagrangian(networks, 0, friction), states) for friction in (None, rows)
    )
    np.testing.assert_allclose(rubbing - without, 0.5 * states[1].numpy(), atol=1e-12)
