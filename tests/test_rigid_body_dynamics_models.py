"""Models of every kind: networks against their definition, in files, on batches and compiled."""

import numpy as np
import pytest
import torch
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from rigid_body_robots import arm, motion_with_friction
from torch.autograd.functional import hessian, jacobian

from structlearn.core.artefacts import write_tensors
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.networks.torch_settings import seeded
from structlearn.rigid_body import dynamics_models as dynamics
from structlearn.rigid_body.dynamics_training import KINDS, LearningParameters, TrainingData, learner
from structlearn.rigid_body.network_models import StackedLagrangianNetworks, StackedPerceptrons

FRICTION = ("viscous", "offset")
PARAMETERS = committed(LearningParameters, "train_dynamics.learning", hidden=(8, 6))
JOINTS = 4


def trained(kind):
    """Two models after some steps: the models, and the errors that their training had."""
    group = learner(
        kind, TrainingData(arm().tree, motion_with_friction(arm()), FRICTION), "raw", (0, 1), PARAMETERS
    )
    group.learn(torch.arange(300))
    perceptron = kind.startswith("mlp")
    hidden = PARAMETERS.hidden if perceptron or kind == "delan" else ()
    friction = () if perceptron else FRICTION
    return dynamics.DynamicsModels(kind, arm().tree.names, friction, hidden, group.state()), group.nmse()


@pytest.mark.parametrize("kind", KINDS)
def test_models_from_a_file_predict_in_batches_and_compiled_what_they_did_in_training(kind, tmp_path):
    models, errors = trained(kind)
    dynamics.write_dynamics_models(models, tmp_path / "models.safetensors")
    back = dynamics.read_dynamics_models(tmp_path / "models.safetensors")
    for name in ("kind", "joints", "friction", "hidden"):
        assert getattr(back, name) == getattr(models, name)
    motion = motion_with_friction(arm())
    torques = dynamics.predicted_torques(back, arm().tree, motion)
    some = motion.part(slice(None, None, 40))
    for model in range(2):
        np.testing.assert_allclose(nmse(torques[model], motion.torque), errors[model], rtol=1e-4)
        one = dynamics.compiled_model(back, model, arm().tree)
        found = np.array([one(*state) for state in zip(some.q, some.qd, some.qdd, strict=True)])
        expected = torques[model, ::40]
        tolerance = 1e-5 if kind in ("mlp", "mlp_scaled", "delan") else 1e-10
        np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())
    assert not np.allclose(torques[0], torques[1])


def test_what_cannot_be_used_is_one_message(tmp_path):
    path = tmp_path / "models.safetensors"
    models, _ = trained("spd")
    with pytest.raises(InputError, match="learned with the joints a, b; the arm has lbr_iiwa_joint_1"):
        dynamics.compiled_model(
            dynamics.DynamicsModels("cov", ("a", "b"), (), (), models.state), 0, arm().tree
        )
    broken = models.state["inertia"].copy()
    broken[0, 0, 0] = np.nan
    incomplete = {"friction": np.zeros((1, 7, 0))}, '{"dynamics_models": {"kind": "spd"}}'
    for tensors, description, message in (
        (*incomplete, r"\(KeyError: 'joints'\)"),
        ({"weights": np.zeros(3)}, "something else", "holds no dynamics models"),
        ({"inertia": broken}, "{}", "inertia holds a value that is not finite"),
    ):
        write_tensors(tensors, path, description)
        with pytest.raises(InputError, match=message):
            dynamics.read_dynamics_models(path)


def test_states_of_a_standardised_network_are_seen_and_torques_given_in_units_of_the_data():
    plain = StackedPerceptrons.initial(2, (4,), [seeded(0)])
    states = list(torch.randn(3, 2, 50, generator=seeded(1)) * 3.0 + 2.0)
    torque = torch.randn(2, 50, generator=seeded(2)) * torch.tensor([[100.0], [0.0]]) + 5.0
    stack = plain.standardised(states, torque)
    mean, scale = torque.mean(dim=1, keepdim=True), stack.output_scale[:, None]
    seen = [
        (values - values.mean(dim=1, keepdim=True)) / values.std(dim=1, correction=0, keepdim=True)
        for values in states
    ]
    torch.testing.assert_close(stack.torques(*states), plain.torques(*seen) * scale + mean)
    torch.testing.assert_close(scale[0, 0], torque[0].std(correction=0))
    assert scale[1] == 1.0  # a constant torque


def networks(seeds=(0, 1)) -> StackedLagrangianNetworks:
    drawn = StackedLagrangianNetworks.initial(JOINTS, (8, 16, 8), [seeded(seed) for seed in seeds])
    arrays = {name: values.double() for name, values in drawn.to_arrays().items()}
    return StackedLagrangianNetworks.from_arrays(arrays)


def test_torques_are_those_of_the_lagrangian_of_each_model_alone():
    """The fast form against automatic differentiation of the energy itself: d/dt dL/dqd - dL/dq."""
    own = networks()
    q, qd, qdd = torch.randn(3, JOINTS, 5, dtype=torch.float64, generator=seeded(3))
    torques = own.torques(q, qd, qdd)
    for model in range(2):
        alone = networks((model,))
        torch.testing.assert_close(alone.torques(q, qd, qdd), torques[[model]], rtol=1e-12, atol=1e-12)

        def lagrangian(position, velocity, its=alone):
            inertia = its.inertia_matrix(position[:, None])[0, 0]
            return 0.5 * velocity @ inertia @ velocity - its.potential_energy(position[:, None])[0, 0]

        for sample in range(5):
            state = q[:, sample], qd[:, sample]
            second, slope = hessian(lagrangian, state), jacobian(lagrangian, state)[0]
            expected = second[1][1] @ qdd[:, sample] + second[1][0] @ qd[:, sample] - slope
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
