"""Dynamics of the latent state: forward models of an action's effect, and inverse models for actions.

Forward (II.3.4):

    z_t+1 = z_t + zd(z_t, a_t) dt                                  (eq. II.6, II.7)
    locally linear:  zd = A(z) z + B(z) a + c(z),  A, B, c by a network of z      (eq. II.8, II.9)
    non-linear:      zd = network of [z, a]                                       (eq. II.10)

Inverse (II.3.5): the action that brings the touch closer to a target, from the forward model's parameters:

    locally linear (LL):      minimise |z_T - z_t+1|^2 / 2 + penalty |a|^2 / 2 in closed form (appendix A)
    negative gradient (NG):   a = -d |f(z, a) - z_T|^2 / da at a = 0, up to a positive factor
    network's Jacobian (NJ):  LL with the non-linear model linearised about the previous step

Beyond the dissertation: the same problem over several steps (`receding_horizon_action`). Tensors are
(M, D, B): models, components, samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from structlearn.networks.stacked_layers import StackedLayers
from structlearn.tactile.latent_parameters import LATENT, NEGATIVE_GRADIENT

ACTION = 6  # components K of an action that translates and rotates; fewer for a skin that is only pressed


@dataclass(frozen=True)
class AffineDynamics:
    """zd = A z + B a + c at each sample."""

    state: Tensor  # A, (M, 3, 3, B)
    action: Tensor  # B, (M, 3, K, B)
    constant: Tensor  # c, (M, 3, B)

    def rate(self, latent: Tensor, action: Tensor) -> Tensor:
        """Rates zd (M, 3, B) of latent states (M, 3, B) and actions (M, K, B)."""
        return applied(self.state, latent) + applied(self.action, action) + self.constant


@dataclass(frozen=True)
class StackedDynamics:
    """M forward models, each a network."""

    network: StackedLayers

    def part(self, models: slice) -> Self:
        """Subset of the models."""
        return type(self)(self.network.part(models))


class LocallyLinearDynamics(StackedDynamics):
    """M locally linear models, whose networks output the entries of A, B and c."""

    @classmethod
    def initial(
        cls, models: int, hidden: Sequence[int], generator: torch.Generator, actions: int = ACTION
    ) -> Self:
        """Untrained models with these hidden layers, for actions of K components."""
        sizes = (LATENT, *hidden, LATENT * (LATENT + actions + 1))
        return cls(StackedLayers.initial(models, sizes, generator))

    @property
    def actions(self) -> int:
        """Number of components K of an action."""
        return self.network.weights[-1].shape[1] // LATENT - LATENT - 1

    def affine(self, latent: Tensor) -> AffineDynamics:
        """A, B and c at latent states (M, 3, B)."""
        parts = self.network.forward(latent).split((LATENT**2, LATENT * self.actions, LATENT), dim=1)
        return AffineDynamics(
            parts[0].unflatten(1, (LATENT, LATENT)), parts[1].unflatten(1, (LATENT, self.actions)), parts[2]
        )

    def rate(self, latent: Tensor, action: Tensor) -> Tensor:
        """Rates zd (M, 3, B) of latent states (M, 3, B) and actions (M, K, B)."""
        return self.affine(latent).rate(latent, action)


class NonLinearDynamics(StackedDynamics):
    """M non-linear models of [z, a] with one tanh hidden layer, whose Jacobians are closed-form."""

    @classmethod
    def initial(cls, models: int, hidden: int, generator: torch.Generator, actions: int = ACTION) -> Self:
        """Untrained models with this number of hidden nodes, for actions of K components."""
        sizes = (LATENT + actions, hidden, LATENT)
        return cls(StackedLayers.initial(models, sizes, generator))

    @property
    def actions(self) -> int:
        """Number of components K of an action."""
        return self.network.weights[0].shape[2] - LATENT

    def rate(self, latent: Tensor, action: Tensor) -> Tensor:
        """Rates zd (M, 3, B) of latent states (M, 3, B) and actions (M, K, B)."""
        return self.network.forward(torch.cat([latent, action], dim=1))

    def jacobians(self, latent: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Jacobians J_z (M, 3, 3, B) and J_a (M, 3, K, B) of zd at (M, 3, B) and (M, K, B) (eq. II.15).

        J = W_2 diag(1 - h^2) W_1 is linear in 1 - h^2, so all entries come from one matrix product.
        """
        first, second = self.network.weights
        slope = 1.0 - self.network.activations(torch.cat([latent, action], dim=1))[-1].square()
        products = (second[:, :, None] * first.transpose(1, 2)[:, None]).flatten(1, 2)  # (M, 3 (3 + K), H)
        jacobian = torch.bmm(products, slope).unflatten(1, (LATENT, LATENT + self.actions))
        return jacobian[:, :, :LATENT], jacobian[:, :, LATENT:]


ForwardDynamics = LocallyLinearDynamics | NonLinearDynamics


def chained(dynamics: ForwardDynamics, latent: Tensor, actions: Tensor, time_step: Tensor) -> Tensor:
    """Latent states (C, M, 3, B) predicted from (M, 3, B) under successive actions (C, M, K, B) (II.3.4).

    `time_step` (B,) or (M, 1, B) s per step.
    """
    predicted = []
    for action in actions:
        latent = latent + dynamics.rate(latent, action) * time_step
        predicted.append(latent)
    return torch.stack(predicted)


def applied(matrix: Tensor, vector: Tensor) -> Tensor:
    """Product (M, I, B) of matrices (M, I, J, B) with vectors (M, J, B)."""
    return (matrix * vector[:, None]).sum(dim=2)


@dataclass(frozen=True)
class LatentStep:
    """State at which an action is chosen, and the previous step."""

    latent: Tensor  # (M, 3, B) z_t
    previous_latent: Tensor  # (M, 3, B) z_t-1
    previous_action: Tensor  # (M, K, B) a_t-1
    time_step: Tensor  # (B,) or (M, 1, B) s, of the previous and the next step


def inferred_action(
    inverse: str, dynamics: ForwardDynamics, step: LatentStep, target: Tensor, penalty: float
) -> Tensor:
    """Action (M, K, B) of an inverse model for a target z_T (M, 3, B) (eq. II.21).

    `inverse`: `LOCALLY_LINEAR` for locally linear dynamics, `NEGATIVE_GRADIENT` or `JACOBIAN` for non-linear
    ones; `penalty`: beta > 0, unused by NG.
    """
    if inverse == NEGATIVE_GRADIENT:
        assert isinstance(dynamics, NonLinearDynamics)
        return negative_gradient(dynamics, step.latent, target, step.time_step)
    return optimal_action(affine_dynamics(dynamics, step), step.latent, target, step.time_step, penalty)


def affine_dynamics(dynamics: ForwardDynamics, step: LatentStep) -> AffineDynamics:
    """Affine model that `LOCALLY_LINEAR` or `JACOBIAN` uses at a step."""
    if isinstance(dynamics, LocallyLinearDynamics):
        return dynamics.affine(step.latent)
    return linearised(dynamics, step)


def optimal_action(
    dynamics: AffineDynamics, latent: Tensor, target: Tensor, time_step: Tensor, penalty: float
) -> Tensor:
    """Appendix A: a = B^T (B B^T + penalty / dt^2 1)^-1 ((z_T - z) / dt - A z - c) (eq. II.13, II.19, II.20).

    `latent` z, `target` z_T (M, 3, B); `time_step` (B,) or (M, 1, B) s. Returns actions (M, K, B).
    """
    wanted = (target - latent) / time_step - applied(dynamics.state, latent) - dynamics.constant
    gram = (dynamics.action[:, :, None] * dynamics.action[:, None]).sum(dim=3)  # (M, 3, 3, B)
    ridge = (penalty / time_step**2).expand_as(wanted[:, :1])[:, None]  # (M, 1, 1, B)
    gram = gram + torch.eye(LATENT, dtype=gram.dtype)[:, :, None] * ridge
    return applied(dynamics.action.transpose(1, 2), _solved(gram, wanted))


def linearised(dynamics: NonLinearDynamics, step: LatentStep) -> AffineDynamics:
    """The non-linear model linearised about the previous step, with the rate observed there.

        zd = (z_t - z_t-1) / dt + J_z (z - z_t-1) + J_a (a - a_t-1)                (eq. II.16)

    At z = z_t this is eq. II.17 and II.18, whose A = 1 / dt + J_z contains the first term. This form is also
    valid at later states, which a longer horizon needs.
    """
    by_latent, by_action = dynamics.jacobians(step.previous_latent, step.previous_action)
    rate = (step.latent - step.previous_latent) / step.time_step
    offset = applied(by_latent, step.previous_latent) + applied(by_action, step.previous_action)
    return AffineDynamics(by_latent, by_action, rate - offset)


def negative_gradient(
    dynamics: NonLinearDynamics, latent: Tensor, target: Tensor, time_step: Tensor
) -> Tensor:
    """-d |f(z, a) - z_T|^2 / da (M, K, B) at a = 0, unscaled (eq. II.14)."""
    rest = latent.new_zeros(latent.shape[0], dynamics.actions, latent.shape[-1])
    _, by_action = dynamics.jacobians(latent, rest)
    missing = target - latent - dynamics.rate(latent, rest) * time_step
    return applied(by_action.transpose(1, 2), 2.0 * time_step * missing)


def receding_horizon_action(
    dynamics: AffineDynamics, latent: Tensor, target: Tensor, time_step: Tensor, penalty: float, horizon: int
) -> Tensor:
    """First action of the optimal sequence over several steps; for one step it is `optimal_action`.

    Minimises sum_k |z_T - z_k|^2 / 2 + penalty sum_k |a_k|^2 / 2 over k = 1..H steps of the same dynamics.
    The states are affine in all actions, z = free + G a, so the solution has the form of appendix A:
    a = G^T (G G^T + penalty 1)^-1 (z_T - free). `latent`, `target` (M, 3, B); `time_step` s.
    """
    state = dynamics.state.permute(0, 3, 1, 2) * time_step + torch.eye(LATENT, dtype=latent.dtype)
    action = dynamics.action.permute(0, 3, 1, 2) * time_step  # (M, B, 3, K)
    constant = dynamics.constant.transpose(1, 2)[..., None] * time_step
    free, goal = latent.transpose(1, 2)[..., None], target.transpose(1, 2)[..., None]
    missing, blocks = [], [action]  # blocks[k]: effect of an action k steps later
    for _ in range(horizon):
        free = state @ free + constant
        missing.append(goal - free)
        blocks.append(state @ blocks[-1])
    nothing = torch.zeros_like(action)
    effects = [
        [blocks[step - cause] if cause <= step else nothing for cause in range(horizon)]
        for step in range(horizon)
    ]
    effect = torch.cat([torch.cat(row, dim=-1) for row in effects], dim=-2)  # (M, B, 3 H, K H)
    gram = effect @ effect.mT + penalty * torch.eye(LATENT * horizon, dtype=latent.dtype)
    multipliers = torch.linalg.solve(gram, torch.cat(missing, dim=-2))
    return (effect.mT[..., : action.shape[-1], :] @ multipliers)[..., 0].transpose(1, 2)


def _solved(matrix: Tensor, vector: Tensor) -> Tensor:
    """S^-1 v by cofactors, for symmetric (M, 3, 3, B) and (M, 3, B); faster than the library's solver."""
    first, second, third = matrix.unbind(dim=1)
    pairs = ((second, third), (third, first), (first, second))
    cofactors = [torch.linalg.cross(*pair, dim=1) for pair in pairs]
    determinant = (first * cofactors[0]).sum(dim=1, keepdim=True)
    return applied(torch.stack(cofactors, dim=1), vector) / determinant
