"""Resting servoing: slopes against closed forms, the best step along a gradient, what steps correct."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from committed import committed
from tactile_toy import doubled, toy_dataset

from structlearn.tactile.latent_dynamics import LatentStep, LocallyLinearDynamics, NonLinearDynamics, applied
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import NetworkParameters
from structlearn.tactile.latent_training import CHAIN_STEPS
from structlearn.tactile.servo_controller import (
    Caution,
    RestingServo,
    ServoParameters,
    action_slope,
    corrected,
    steepest_action,
)
from structlearn.tactile.touch_dataset import LINEAR, TRAIN, TouchUnits, chains, touch_units

LIKELY = torch.tensor([1.5, 0.2, 0.3, 1.2, 0.05, 0.04], dtype=torch.float64)[:, None]
DT = torch.tensor([0.31], dtype=torch.float64)
UNITS = TouchUnits(
    signal_mean=np.zeros(19),
    signal_scale=np.ones(19),
    pressure_mean=np.array(0.0),
    pressure_scale=np.array(1.0),
    length=np.array(0.01),
    action_scale=np.array([0.004] * 3 + [0.2] * 3),
    likely_action=np.array([0.004] * 3 + [0.2] * 3) * LIKELY[:, 0].numpy(),
)


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


def test_likely_actions_are_those_of_the_training_split():
    """Of one component; their scales are of one kind, linear or angular, over its components."""
    dataset = toy_dataset(contacts=10)
    taught = chains(dataset, CHAIN_STEPS, split=TRAIN)
    units = touch_units(dataset, taught, 0.01)
    squared = np.square(taught.actions.reshape(-1, 6)).mean(axis=0)
    np.testing.assert_allclose(units.likely_action, np.sqrt(squared), rtol=1e-5)
    for part in (slice(0, LINEAR), slice(LINEAR, None)):
        np.testing.assert_allclose(units.action_scale[part], np.sqrt(squared[part].mean()), rtol=1e-5)


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
    even, _ = controller(inverse, horizon, by_likelihood=False, action_penalty=1e4)
    target = latent + 0.1
    action, plain = (one.act(latent, target, one.start(latent))[0] for one in (servo, even))
    share = np.abs(action[..., 4]) / np.linalg.norm(action[..., 3:], axis=-1)
    assert np.median(share) < 0.2 * np.median(np.abs(plain[..., 4]) / np.linalg.norm(plain[..., 3:], axis=-1))


def test_steps_correct_the_slopes_to_what_they_do():
    """Whatever the model says, after steps in all directions the slopes are the true ones, and stay so."""
    true, wrong = random(2, 3, 6, 5), random(2, 3, 6, 5, seed=1)
    error, missed = torch.zeros_like(wrong), []
    for number in range(400):
        action = random(2, 6, 5, seed=number + 2)
        before = random(2, 3, 5, seed=number)
        step = LatentStep(before + DT * applied(true, action), before, action * LIKELY, DT)
        error = corrected(error, wrong, step, LIKELY, 1.0)
        missed.append((wrong + error - true).norm(dim=(1, 2)))
    assert all(
        (after <= before + 1e-12).all() for before, after in pairwise(missed)
    )  # Frobenius, as Broyden's
    assert missed[-1].max() < 1e-3 * missed[0].max()


def test_rest_says_nothing_of_slopes():
    still = random(2, 3, 5)
    step = LatentStep(still + 0.1, still, torch.zeros(2, 6, 5, dtype=torch.float64), DT)
    error = random(2, 3, 6, 5, seed=1)
    assert torch.equal(corrected(error, random(2, 3, 6, 5, seed=2), step, LIKELY, 1.0), error)


def test_what_a_trial_corrects_no_other_trial_sees():
    """Also where both are of one model: memories are their own, and a memory may be used again."""
    servo, latent = controller("NJ")
    target, moved = latent + 0.1, latent + 0.05
    _, memory = servo.act(latent, target, servo.start(latent))
    same, other = moved.copy(), moved.copy()
    other[:, 1:] += 0.3
    first, second = (servo.act(seen, target, memory)[0] for seen in (same, other))
    np.testing.assert_allclose(first[:, 0], second[:, 0], atol=1e-12)
    assert not np.allclose(first[:, 1], second[:, 1])
    np.testing.assert_array_equal(servo.act(same, target, memory)[0], first)


def controller(inverse, horizon=1, by_likelihood=True, action_penalty=0.01):
    models = LatentModels.initial(
        (0, 1), 19, committed(NetworkParameters, "train_latent.networks"), torch.Generator().manual_seed(3)
    ).detached()
    parameters = ServoParameters(inverse=inverse, horizon=horizon, action_penalty=action_penalty)
    servo = RestingServo(models, UNITS, True, parameters, 100 / 31, 6, Caution(by_likelihood, 1.5, 1.0))
    return servo, np.random.default_rng(0).normal(size=(2, 7, 3))
