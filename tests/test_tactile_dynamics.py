"""Forward and inverse dynamics of the latent state."""

import numpy as np
import pytest
import torch
from scipy.optimize import minimize
from tactile_toy import doubled

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
from structlearn.tactile.latent_models import StackedAutoencoders, latent_losses

DT = 0.31
MODELS, SAMPLES = 2, 5


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
        torch.tensor([DT], dtype=torch.float64),
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
    time_step = torch.tensor([DT], dtype=torch.float64)
    torch.testing.assert_close(negative_gradient(dynamics, latent, target, time_step), -gradient)


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
        time_step = torch.tensor([DT], dtype=torch.float64)
        torch.testing.assert_close(found, optimal_action(dynamics, latent, target, time_step, penalty))


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
