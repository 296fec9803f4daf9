"""Cautious servoing: slopes against closed forms, the best step along a gradient, loops on the own model."""

import numpy as np
import pytest
import torch
from committed import committed
from tactile_toy import doubled, toy_dataset

from structlearn.tactile.forward_dynamics import LocallyLinearDynamics, NonLinearDynamics, applied
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import NetworkParameters
from structlearn.tactile.resting_servo import (
    Caution,
    RestingServo,
    action_slope,
    demonstrated_actions,
    steepest_action,
)
from structlearn.tactile.servo_controller import ServoParameters
from structlearn.tactile.touch_dataset import TRAIN, chains
from structlearn.tactile.units import TouchUnits

LIKELY = torch.tensor([1.5, 0.2, 0.3, 1.2, 0.05, 0.04], dtype=torch.float64)[:, None]
UNITS = TouchUnits(
    signal_mean=np.zeros(19),
    signal_scale=np.ones(19),
    pressure_mean=np.array(0.0),
    pressure_scale=np.array(1.0),
    length=np.array(0.01),
    action_scale=np.array([0.004] * 3 + [0.2] * 3),
)

DEMONSTRATED = UNITS.action_scale * LIKELY[:, 0].numpy()


@pytest.fixture(scope="module")
def nonlinear():
    return doubled(NonLinearDynamics.initial(2, 15, torch.Generator().manual_seed(0)))


def random(*shape, seed=0):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_slopes_over_a_short_distance_are_derivatives(nonlinear):
    latent = random(2, 3, 5)
    near = action_slope(nonlinear, latent, LIKELY, 1e-4)
    torch.testing.assert_close(near, action_slope(nonlinear, latent, LIKELY, 0.0), atol=1e-6, rtol=1e-6)


def test_slopes_of_a_locally_linear_model_are_its_matrix():
    dynamics = doubled(LocallyLinearDynamics.initial(2, (8, 5), torch.Generator().manual_seed(1)))
    latent = random(2, 3, 5)
    torch.testing.assert_close(
        action_slope(dynamics, latent, LIKELY, 1.5), dynamics.affine(latent).action, atol=0, rtol=0
    )


def test_the_steepest_action_is_the_best_on_its_line():
    slope, missing, ridge = random(2, 3, 6, 4), random(2, 3, 4, seed=1), torch.tensor([0.3])
    best = steepest_action(slope, missing, ridge)

    def cost(action):
        return (missing - applied(slope, action)).square().sum(1) + ridge * action.square().sum(1)

    downhill = applied(slope.transpose(1, 2), missing)
    assert torch.allclose(torch.cosine_similarity(best, downhill, dim=1), torch.ones(2, 4).double())
    for factor in (0.9, 1.1):
        assert (cost(best) < cost(factor * best)).all()


def test_no_slope_asks_for_no_action():
    assert (steepest_action(torch.zeros(1, 3, 6, 2), torch.ones(1, 3, 2), torch.zeros(1)) == 0).all()


def test_likely_actions_are_those_of_the_training_split():
    dataset = toy_dataset(contacts=10)
    actions = chains(dataset, 1, split=TRAIN).actions[:, 0]
    np.testing.assert_allclose(demonstrated_actions(dataset), np.sqrt((actions**2).mean(axis=0)), rtol=1e-5)


@pytest.mark.parametrize("inverse", ["LL", "NG", "NJ"])
def test_at_its_target_a_finger_is_left_alone(inverse):
    """Whatever the untrained model says of rest."""
    servo, latent = controller(inverse)
    action, _ = servo.act(latent, latent, servo.start(latent))
    np.testing.assert_allclose(action, 0, atol=1e-12)


@pytest.mark.parametrize(("inverse", "horizon"), [("LL", 1), ("NJ", 1), ("LL", 3), ("NJ", 3)])
def test_unlikely_actions_are_spared(inverse, horizon):
    """With a heavy penalty an action is the scales squared times a gradient, so it has hardly pitch."""
    servo, latent = controller(inverse, horizon, action_penalty=1e4)
    even, _ = controller(inverse, horizon, likely=None, action_penalty=1e4)
    target = latent + 0.1
    action, plain = (one.act(latent, target, one.start(latent))[0] for one in (servo, even))
    share = np.abs(action[..., 4]) / np.linalg.norm(action[..., 3:], axis=-1)
    assert np.median(share) < 0.2 * np.median(np.abs(plain[..., 4]) / np.linalg.norm(plain[..., 3:], axis=-1))


def controller(inverse, horizon=1, likely=DEMONSTRATED, action_penalty=0.01):
    models = LatentModels.initial(
        (0, 1), 19, committed(NetworkParameters, "train_latent.networks"), torch.Generator().manual_seed(3)
    ).detached()
    parameters = ServoParameters(inverse=inverse, horizon=horizon, action_penalty=action_penalty)
    servo = RestingServo(models, UNITS, True, parameters, 100 / 31, Caution(likely, 1.5, 0.5))
    return servo, np.random.default_rng(0).normal(size=(2, 7, 3))
