"""Forward dynamics of the latent state (II.3.4): what an action does to the map point and the pressure.

    z_t+1 = z_t + zd(z_t, a_t) dt                                  (eq. II.7)
    locally linear:  zd = A(z) z + B(z) a + c(z),  A, B, c by a network of z      (eq. II.8, II.9)
    non-linear:      zd = network of [z, a]                                       (eq. II.10)

Tensors are (M, D, B): models, components, samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from structlearn.networks.stacked_layers import StackedLayers
from structlearn.tactile.autoencoder import LATENT

ACTION = 6
"""Components of the action of a finger that also turns; a skin that is only pressed has fewer (K)."""


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
class LocallyLinearDynamics:
    """M locally linear models."""

    network: StackedLayers  # gives the entries of A, B and c

    @classmethod
    def initial(
        cls, models: int, hidden: Sequence[int], generator: torch.Generator, actions: int = ACTION
    ) -> Self:
        """Models to be trained, with a network of these hidden layers, for actions of K components."""
        sizes = (LATENT, *hidden, LATENT * (LATENT + actions + 1))
        return cls(StackedLayers.initial(models, sizes, generator))

    def part(self, models: slice) -> Self:
        """Some of the models."""
        return type(self)(self.network.part(models))

    @property
    def actions(self) -> int:
        """Components of an action K."""
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


@dataclass(frozen=True)
class NonLinearDynamics:
    """M non-linear models with one hidden layer of tanh, whose Jacobians are closed-form."""

    network: StackedLayers  # of [z, a]

    @classmethod
    def initial(cls, models: int, hidden: int, generator: torch.Generator, actions: int = ACTION) -> Self:
        """Models to be trained, with so many nodes in the hidden layer, for actions of K components."""
        sizes = (LATENT + actions, hidden, LATENT)
        return cls(StackedLayers.initial(models, sizes, generator))

    def part(self, models: slice) -> Self:
        """Some of the models."""
        return type(self)(self.network.part(models))

    @property
    def actions(self) -> int:
        """Components of an action K."""
        return self.network.weights[0].shape[2] - LATENT

    def rate(self, latent: Tensor, action: Tensor) -> Tensor:
        """Rates zd (M, 3, B) of latent states (M, 3, B) and actions (M, K, B)."""
        return self.network.forward(torch.cat([latent, action], dim=1))

    def jacobians(self, latent: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Jacobians of zd with respect to the latent state and to the action (eq. II.15).

        J = W_2 diag(1 - h^2) W_1 is linear in 1 - h^2, so all its entries are one matrix product. `latent`
        (M, 3, B); `action` (M, K, B). Returns `J_z` (M, 3, 3, B); `J_a` (M, 3, K, B).
        """
        first, second = self.network.weights
        slope = 1.0 - self.network.activations(torch.cat([latent, action], dim=1))[-1].square()
        products = (second[:, :, None] * first.transpose(1, 2)[:, None]).flatten(1, 2)  # (M, 3 (3 + K), H)
        jacobian = torch.bmm(products, slope).unflatten(1, (LATENT, LATENT + self.actions))
        return jacobian[:, :, :LATENT], jacobian[:, :, LATENT:]


ForwardDynamics = LocallyLinearDynamics | NonLinearDynamics


def chained(dynamics: ForwardDynamics, latent: Tensor, actions: Tensor, time_step: Tensor) -> Tensor:
    """Latent states predicted one from the other (II.3.4).

    `latent` (M, 3, B) at the start; `actions` (C, M, K, B) successive actions; `time_step` (B,) s or (M, 1,
    B) s, per step. Returns (C, M, 3, B) after each action.
    """
    predicted = []
    for action in actions:
        latent = latent + dynamics.rate(latent, action) * time_step
        predicted.append(latent)
    return torch.stack(predicted)


def applied(matrix: Tensor, vector: Tensor) -> Tensor:
    """Product (M, I, B) of matrices (M, I, J, B) with vectors (M, J, B)."""
    return (matrix * vector[:, None]).sum(dim=2)
