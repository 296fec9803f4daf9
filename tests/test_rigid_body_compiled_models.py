import numpy as np
import pytest
import torch
from committed import committed
from rigid_body_robots import robot

from structlearn.ground.errors import InputError
from structlearn.rigid_body.dynamics_models import DynamicsModels, compiled_model
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.learner import LearningParameters, Lesson, learner
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.newton_euler import inverse_dynamics
from structlearn.rigid_body.tree import LinkInertias

FRICTION = ("viscous", "coulomb")
SEEDS = (0, 1, 2)
LEARNING = committed(LearningParameters, "train_dynamics.learning", hidden=(8, 8))


@pytest.fixture(scope="module")
def tree():
    return robot("iiwa").tree


@pytest.fixture(scope="module")
def motion():
    return Motion(*np.random.default_rng(0).normal(size=(4, 300, 7)))


@pytest.mark.parametrize("kind", ["mlp", "mlp_scaled", "delan", "cov", "nostr"])
def test_every_seed_of_every_kind_has_the_errors_that_its_training_had(kind, tree, motion):
    group = learner(kind, Lesson(tree, motion, FRICTION), "raw", SEEDS, LEARNING)
    group.learn(torch.arange(100))
    networks = kind in ("mlp", "mlp_scaled", "delan")
    friction = () if kind in ("mlp", "mlp_scaled") else FRICTION
    hidden = LEARNING.hidden if networks else ()
    models = DynamicsModels(kind, tree.names, friction, hidden, group.state())
    expected = group.nmse()
    for seed in SEEDS:
        torques = compiled_model(models, seed, tree)
        found = np.array([torques(*state) for state in zip(motion.q, motion.qd, motion.qdd, strict=True)])
        errors = ((found - motion.torque) ** 2).mean(axis=0) / motion.torque_variance
        np.testing.assert_allclose(errors, expected[seed], rtol=1e-4 if networks else 1e-9)
    assert not np.allclose(expected[0], expected[1])


def test_inertias_and_friction_act_together(tree, motion):
    group = learner("cov", Lesson(tree, motion, FRICTION), "raw", SEEDS, LEARNING)
    models = DynamicsModels("cov", tree.names, FRICTION, (), group.state())
    state = (motion.q[0], motion.qd[0], motion.qdd[0])
    every = models.inertias()
    own = LinkInertias(every.mass[1], every.first_moment[1], every.inertia[1]).tensors()
    rigid = inverse_dynamics(tree, own, *(torch.tensor(values[None]) for values in state))[0].numpy()
    rubbing = (friction_columns(state[1], FRICTION) * models.friction_coefficients()[1]).sum(axis=-1)
    np.testing.assert_allclose(compiled_model(models, 1, tree)(*state), rigid + rubbing, atol=1e-9)


def test_models_of_another_arm_are_refused(tree, motion):
    group = learner("cov", Lesson(tree, motion), "raw", SEEDS, LEARNING)
    models = DynamicsModels("cov", ("a", "b"), (), (), group.state())
    with pytest.raises(InputError, match="learned with the joints a, b; the arm has lbr_iiwa_joint_1"):
        compiled_model(models, 0, tree)
