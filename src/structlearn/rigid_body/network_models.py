"""Networks as models of inverse dynamics, M of them (seeds, robots) as one stack.

A perceptron gives torques of (q, qd, qdd). A deep Lagrangian network has a learned inertia matrix and a
learned potential energy:

    H(q) = L(q) L(q)^T + b 1      tau = H qdd + (dH/dt) qd - 1/2 d(qd^T H qd)/dq + dV/dq

L and V are networks of q. The Coriolis terms need no Jacobian of L, which has n^2 (n + 1) / 2 entries per
sample. With Ldot = (dL/dq) qd from one tangent pass along qd,

    (dH/dt) qd = L Ldot^T qd + Ldot L^T qd      1/2 d(qd^T H qd)/dq = (dL/dq)^T [qd (L^T qd)^T]

where the last is one adjoint pass through L. Both passes are written out, so that they can be differentiated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn import functional

from structlearn.networks.stacked_layers import StackedLayers

SCALING = ("input_mean", "input_scale", "output_mean", "output_scale")
"""Tensors that all models of a stack have in common."""


@dataclass(frozen=True)
class StackedPerceptrons:
    """M networks from (q, qd, qdd) to torques.

    Attributes:
        network: of 3 n inputs and n outputs.
        input_mean: (3 n,) taken off the states.
        input_scale: (3 n,) by which they are divided.
        output_mean: (n,) N m.
        output_scale: (n,) N m.
    """

    network: StackedLayers
    input_mean: Tensor
    input_scale: Tensor
    output_mean: Tensor
    output_scale: Tensor

    @classmethod
    def initial(cls, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]) -> Self:
        """Networks to be trained on plain states and torques, one per generator."""
        scaling = [plain(size) for size in (3 * joints, joints) for plain in (torch.zeros, torch.ones)]
        return cls(StackedLayers.uniform((3 * joints, *hidden, joints), generators), *scaling)

    def standardised(self, states: Sequence[Tensor], torque: Tensor) -> Self:
        """The networks that see and give standardised values, which the dissertation's do not.

        As positions, velocities and accelerations (n, N) and torques (n, N) of the training set are scaled.
        """
        scaling = (*_mean_and_scale(torch.cat(list(states))), *_mean_and_scale(torque))
        scales: dict[str, Any] = dict(zip(SCALING, scaling, strict=True))
        return replace(self, **scales)

    def parameters(self) -> list[Tensor]:
        """Trained parameters."""
        return self.network.parameters()

    def torques(self, q: Tensor, qd: Tensor, qdd: Tensor) -> Tensor:
        """Torques (M, n, B) in N m of states (n, B) for all models, or (M, n, B)."""
        inputs = (torch.cat([q, qd, qdd], dim=-2) - self.input_mean[:, None]) / self.input_scale[:, None]
        outputs = self.network.forward(inputs.expand(self.network.models, -1, -1))
        return outputs * self.output_scale[:, None] + self.output_mean[:, None]

    def to_arrays(self) -> dict[str, Tensor]:
        """All tensors by name, e.g. `network.weights.0`, without gradients."""
        return self.network.to_arrays("network.") | {name: getattr(self, name) for name in SCALING}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Tensor]) -> Self:
        """The inverse of `to_arrays`."""
        return cls(StackedLayers.from_arrays(arrays, "network."), *(arrays[name] for name in SCALING))


def _mean_and_scale(values: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (D,) of (D, N); a constant row has the scale 1."""
    scale = values.std(dim=1, correction=0)
    return values.mean(dim=1), torch.where(scale > 0.0, scale, 1.0)


SMALLEST_INERTIA = 1e-3
"""kg m^2 (b): keeps H positive definite whatever the network says."""


@dataclass(frozen=True)
class StackedLagrangianNetworks:
    """M deep Lagrangian networks.

    L is lower triangular. Its n (n + 1) / 2 entries, diagonal first, are outputs of a network, the diagonal
    through a softplus, so that every H has one L only.

    Attributes:
        inertia: gives the entries of L.
        potential: gives V.
        row: (entries, n) choice of each entry's row: a product with it is a sum over the matrix.
        column: (entries, n) of its column.
    """

    inertia: StackedLayers
    potential: StackedLayers
    row: Tensor
    column: Tensor

    @classmethod
    def initial(cls, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]) -> Self:
        """Networks to be trained, one per generator; both have the same hidden layers."""
        below = torch.tril_indices(joints, joints, offset=-1)
        diagonal = torch.arange(joints).expand(2, -1)
        row, column = torch.cat([diagonal, below], dim=1)
        return cls(
            StackedLayers.uniform((joints, *hidden, len(row)), generators),
            StackedLayers.uniform((joints, *hidden, 1), generators),
            torch.eye(joints)[row],
            torch.eye(joints)[column],
        )

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.row.shape[1]

    def parameters(self) -> list[Tensor]:
        """Trained parameters."""
        return self.inertia.parameters() + self.potential.parameters()

    def to_arrays(self) -> dict[str, Tensor]:
        """All tensors by name, e.g. `inertia.weights.0`, without gradients."""
        layers = self.inertia.to_arrays("inertia.") | self.potential.to_arrays("potential.")
        return layers | {"row": self.row, "column": self.column}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Tensor]) -> Self:
        """The inverse of `to_arrays`."""
        inertia = StackedLayers.from_arrays(arrays, "inertia.")
        potential = StackedLayers.from_arrays(arrays, "potential.")
        return cls(inertia, potential, arrays["row"], arrays["column"])

    def torques(self, q: Tensor, qd: Tensor, qdd: Tensor) -> Tensor:
        """Torques (M, n, B) in N m of states (n, B) for all models, or (M, n, B)."""
        q, rate = (values.expand(self.inertia.models, -1, -1) for values in (q, qd))
        values = self.inertia.activations(q)
        factor, slope = self._factor(self.inertia.output(values[-1]))
        factor_rate = slope * _tangent(self.inertia, values, rate)

        row_velocity, row_acceleration = self.row @ qd, self.row @ qdd
        momentum = self.column @ (self.column.mT @ (factor * row_velocity))  # of L^T qd, the column's entry
        bracket = self.column.mT @ (factor * row_acceleration + factor_rate * row_velocity)
        inertial = self.row.mT @ (factor * (self.column @ bracket) + factor_rate * momentum)

        centrifugal = _adjoint(self.inertia, values, slope * (row_velocity * momentum))
        levels = self.potential.activations(q)
        gravity = _adjoint(self.potential, levels, torch.ones_like(q[:, :1]))
        return inertial + SMALLEST_INERTIA * qdd - centrifugal + gravity

    def inertia_matrix(self, q: Tensor) -> Tensor:
        """H (M, B, n, n) in kg m^2 at positions (n, B)."""
        values = self.inertia.activations(q.expand(self.inertia.models, -1, -1))
        factor, _ = self._factor(self.inertia.output(values[-1]))
        matrix = torch.einsum("ei,ej,meb->mbij", self.row, self.column, factor)
        return matrix @ matrix.mT + SMALLEST_INERTIA * torch.eye(self.joints, dtype=q.dtype)

    def potential_energy(self, q: Tensor) -> Tensor:
        """V (M, B) in J, up to a constant, at positions (n, B)."""
        values = self.potential.activations(q.expand(self.potential.models, -1, -1))
        return self.potential.output(values[-1]).squeeze(1)

    def _factor(self, raw: Tensor) -> tuple[Tensor, Tensor]:
        """Entries of L (M, entries, B) and their slopes against the network's outputs."""
        diagonal, below = raw[:, : self.joints], raw[:, self.joints :]
        factor = torch.cat([functional.softplus(diagonal), below], dim=1)
        return factor, torch.cat([torch.sigmoid(diagonal), torch.ones_like(below)], dim=1)


def _tangent(network: StackedLayers, values: Sequence[Tensor], direction: Tensor) -> Tensor:
    """Change of a network's outputs (M, K, B) along a direction (M, D, B) of its inputs."""
    for value, weights in zip(values, network.weights[:-1], strict=True):
        direction = (1.0 - value * value) * torch.bmm(weights, direction)
    return torch.bmm(network.weights[-1], direction)


def _adjoint(network: StackedLayers, values: Sequence[Tensor], cotangent: Tensor) -> Tensor:
    """Gradient (M, D, B) at a network's inputs of its outputs times a cotangent (M, K, B)."""
    for value, weights in zip(reversed(values), reversed(network.weights[1:]), strict=True):
        cotangent = (1.0 - value * value) * torch.bmm(weights.mT, cotangent)
    return torch.bmm(network.weights[0].mT, cotangent)
