"""Forward and inverse dynamics of the latent state as published, and adaptive controllers."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from committed import committed
from scipy.optimize import minimize
from tactile_toy import doubled, toy_dataset

from structlearn.tactile.latent_dynamics import (
    AffineDynamics,
    LatentStep,
    LocallyLinearDynamics,
    NonLinearDynamics,
    applied,
    chained,
    linearised,
    negative_gradient,
    optimal_action,
    receding_horizon_action,
)
from structlearn.tactile.latent_models import LatentModels, StackedAutoencoders, latent_losses
from structlearn.tactile.latent_parameters import LatentNetworkParameters
from structlearn.tactile.latent_training import CHAIN_STEPS
from structlearn.tactile.servo_controller import (
    AdaptiveServo,
    ModelTrust,
    ServoParameters,
    action_slope,
    corrected,
    steepest_action,
)
from structlearn.tactile.touch_dataset import LINEAR, TRAIN, TouchUnits, chains, touch_units

DT = 0.31
STEP = torch.tensor([DT], dtype=torch.float64)
MODELS, SAMPLES = 2, 5
LIKELY = torch.tensor([1.5, 0.2, 0.3, 1.2, 0.05, 0.04], dtype=torch.float64)[:, None]
UNITS = TouchUnits(
    signal_mean=np.zeros(19),
    signal_scale=np.ones(19),
    pressure_mean=np.array(0.0),
    pressure_scale=np.array(1.0),
    length=np.array(0.01),
    action_scale=np.array([0.004] * 3 + [0.2] * 3),
    likely_action=np.array([0.004] * 3 + [0.2] * 3) * LIKELY[:, 0].numpy(),
)


def draw(*shape, seed=0):
    return torch.tensor(np.random.default_rng([seed, *shape]).normal(size=shape))


def nonlinear():
    return doubled(NonLinearDynamics.initial(MODELS, 15, torch.Generator().manual_seed(0)))


def locally_linear():
    return doubled(LocallyLinearDynamics.initial(MODELS, (8, 15, 23), torch.Generator().manual_seed(0)))


def affine(seed=0):
    shapes = (MODELS, 3, 3, SAMPLES), (MODELS, 3, 6, SAMPLES), (MODELS, 3, SAMPLES)
    return AffineDynamics(*(draw(*shape, seed=seed) for shape in shapes))


def step():
    return LatentStep(
        draw(MODELS, 3, SAMPLES),
        draw(MODELS, 3, SAMPLES, seed=1),
        draw(MODELS, 6, SAMPLES),
        STEP,
    )


def test_jacobians_are_those_of_finite_differences():
    dynamics, latent, action = nonlinear(), draw(MODELS, 3, SAMPLES), draw(MODELS, 6, SAMPLES)
    slopes, small = dynamics.jacobians(latent, action), 1e-6
    for place, argument in enumerate((latent, action)):
        for component in range(argument.shape[1]):
            change = [torch.zeros_like(latent), torch.zeros_like(action)]
            change[place][:, component] = small
            above = dynamics.rate(latent + change[0], action + change[1])
            below = dynamics.rate(latent - change[0], action - change[1])
            slope = (above - below) / (2 * small)
            torch.testing.assert_close(slopes[place][:, :, component], slope, atol=1e-8, rtol=1e-6)


def test_locally_linear_rate_is_its_matrices():
    dynamics, latent, action = locally_linear(), draw(MODELS, 3, SAMPLES), draw(MODELS, 6, SAMPLES)
    found, rate = dynamics.affine(latent), dynamics.rate(latent, action)
    for model in range(MODELS):
        for sample in range(SAMPLES):
            expected = (
                found.state[model, :, :, sample] @ latent[model, :, sample]
                + found.action[model, :, :, sample] @ action[model, :, sample]
                + found.constant[model, :, sample]
            )
            torch.testing.assert_close(rate[model, :, sample], expected)


def test_chain_feeds_predictions_back():
    dynamics, latent, actions = nonlinear(), draw(MODELS, 3, SAMPLES), draw(3, MODELS, 6, SAMPLES)
    time_step = torch.linspace(0.29, 0.33, SAMPLES, dtype=torch.float64)
    states = chained(dynamics, latent, actions, time_step)
    for before, after, action in zip([latent, *states[:-1]], states, actions, strict=True):
        torch.testing.assert_close(after, before + dynamics.rate(before, action) * time_step)


def test_jacobian_model_is_equation_18_of_the_text():
    dynamics, at, action = nonlinear(), step(), draw(MODELS, 6, SAMPLES, seed=7)
    by_latent, by_action = dynamics.jacobians(at.previous_latent, at.previous_action)
    state = by_latent + torch.eye(3, dtype=torch.float64)[:, :, None] / DT
    constant = -applied(state, at.previous_latent) - applied(by_action, at.previous_action)
    expected = applied(state, at.latent) + applied(by_action, action) + constant
    torch.testing.assert_close(linearised(dynamics, at).rate(at.latent, action), expected)


def test_negative_gradient_is_that_of_autograd():
    dynamics, latent, target = nonlinear(), draw(MODELS, 3, SAMPLES), draw(MODELS, 3, SAMPLES, seed=3)
    action = torch.zeros(MODELS, 6, SAMPLES, dtype=torch.float64, requires_grad=True)
    distance = (latent + dynamics.rate(latent, action) * DT - target).square().sum()
    (gradient,) = torch.autograd.grad(distance, action)
    torch.testing.assert_close(negative_gradient(dynamics, latent, target, STEP), -gradient)


@pytest.mark.parametrize("horizon", [1, 2, 5])
def test_horizon_is_what_a_numerical_solver_finds(horizon):
    dynamics, penalty = affine(), 0.2
    latent, target = draw(MODELS, 3, SAMPLES), draw(MODELS, 3, SAMPLES, seed=2)
    found = receding_horizon_action(dynamics, latent, target, DT, penalty, horizon)

    def cost(actions):
        state, total = latent[0, :, 3].numpy(), 0.5 * penalty * np.sum(actions**2)
        for action in actions.reshape(horizon, 6):
            rate = dynamics.state[0, :, :, 3].numpy() @ state + dynamics.action[0, :, :, 3].numpy() @ action
            state = state + DT * (rate + dynamics.constant[0, :, 3].numpy())
            total += 0.5 * np.sum((target[0, :, 3].numpy() - state) ** 2)
        return total

    solved = minimize(cost, np.zeros(6 * horizon), method="BFGS", options={"gtol": 1e-10})
    np.testing.assert_allclose(found[0, :, 3].numpy(), solved.x[:6], atol=2e-5)
    if horizon == 1:
        torch.testing.assert_close(found, optimal_action(dynamics, latent, target, STEP, penalty))


def test_losses_are_those_of_the_text():
    stack = StackedAutoencoders.initial(2, 6, (5, 4), torch.Generator().manual_seed(0))
    rng = np.random.default_rng(0)
    signals, pressure, geodesic = rng.normal(size=(2, 6, 8)), rng.normal(size=(2, 8)), rng.random((2, 4))
    losses = latent_losses(
        stack, *(torch.tensor(values, dtype=torch.float32) for values in (signals, pressure, geodesic))
    )
    inputs = torch.tensor(signals, dtype=torch.float32)
    latent = stack.encoder.forward(inputs, training=True).detach()
    decoded = stack.decoder.forward(latent, training=True).detach().numpy()
    latent = latent.numpy()
    apart = np.hypot(*np.moveaxis(latent[:, :2, :4] - latent[:, :2, 4:], 1, 0))
    errors = {"distances": apart - geodesic, "pressure": latent[:, 2] - pressure}
    for name, error in (errors | {"reconstruction": decoded - signals}).items():
        expected = np.square(error).reshape(2, -1).mean(axis=1)
        np.testing.assert_allclose(getattr(losses, name).detach(), expected, rtol=1e-4)


def test_two_samples_at_one_point_have_a_gradient():
    stack = StackedAutoencoders.initial(1, 6, (5,), torch.Generator().manual_seed(0))
    same = torch.randn(1, 6, 4).repeat(1, 1, 2)
    losses = latent_losses(stack, same, torch.zeros(1, 8), torch.ones(1, 4))
    found = torch.autograd.grad(losses.distances.sum(), stack.encoder.weights)
    assert all(gradient.isfinite().all() for gradient in found)


# --- adaptive controllers: slopes, the best step along a gradient, what steps correct


def test_slopes_over_a_short_distance_are_derivatives():
    dynamics, latent = nonlinear(), draw(2, 3, 5)
    near = action_slope(dynamics, latent, LIKELY, 1e-4)
    torch.testing.assert_close(near, action_slope(dynamics, latent, LIKELY, 0.0), atol=1e-6, rtol=1e-6)


def test_slopes_of_a_locally_linear_model_are_its_matrix():
    dynamics = doubled(LocallyLinearDynamics.initial(2, (8, 5), torch.Generator().manual_seed(1)))
    latent = draw(2, 3, 5)
    torch.testing.assert_close(
        action_slope(dynamics, latent, LIKELY, 1.5), dynamics.affine(latent).action, atol=0, rtol=0
    )


def test_the_steepest_action_is_the_best_on_its_line():
    slope, missing, ridge = draw(2, 3, 6, 4), draw(2, 3, 4, seed=1), torch.tensor([0.3])
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
    training = chains(dataset, CHAIN_STEPS, split=TRAIN)
    units = touch_units(dataset, training, 0.01)
    squared = np.square(training.actions.reshape(-1, 6)).mean(axis=0)
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
    true, wrong = draw(2, 3, 6, 5), draw(2, 3, 6, 5, seed=1)
    error, missed = torch.zeros_like(wrong), []
    for number in range(400):
        action = draw(2, 6, 5, seed=number + 2)
        before = draw(2, 3, 5, seed=number)
        step = LatentStep(before + DT * applied(true, action), before, action * LIKELY, STEP)
        error = corrected(error, wrong, step, LIKELY, 1.0)
        missed.append((wrong + error - true).norm(dim=(1, 2)))
    assert all(
        (after <= before + 1e-12).all() for before, after in pairwise(missed)
    )  # Frobenius, as Broyden's
    assert missed[-1].max() < 1e-3 * missed[0].max()


def test_rest_says_nothing_of_slopes():
    still = draw(2, 3, 5)
    step = LatentStep(still + 0.1, still, torch.zeros(2, 6, 5, dtype=torch.float64), STEP)
    error = draw(2, 3, 6, 5, seed=1)
    assert torch.equal(corrected(error, draw(2, 3, 6, 5, seed=2), step, LIKELY, 1.0), error)


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
        (0, 1),
        19,
        committed(LatentNetworkParameters, "train_latent.networks"),
        torch.Generator().manual_seed(3),
    ).detached()
    parameters = ServoParameters(inverse=inverse, horizon=horizon, action_penalty=action_penalty)
    servo = AdaptiveServo(models, UNITS, True, parameters, 100 / 31, 6, ModelTrust(by_likelihood, 1.5, 1.0))
    return servo, np.random.default_rng(0).normal(size=(2, 7, 3))
