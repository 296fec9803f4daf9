"""Neural networks for inverse dynamics, M of them (seeds, robots) in one stack, and their training.

A perceptron maps (q, qd, qdd) to torques. A deep Lagrangian network has a learned inertia matrix and a
learned potential energy:

    H(q) = L(q) L(q)^T + b 1      tau = H qdd + (dH/dt) qd - 1/2 d(qd^T H qd)/dq + dV/dq

L and V are networks of q. The Coriolis terms do not need the Jacobian of L, which has n^2 (n + 1) / 2 entries
per sample. With Ldot = (dL/dq) qd from one tangent pass along qd,

    (dH/dt) qd = L Ldot^T qd + Ldot L^T qd      1/2 d(qd^T H qd)/dq = (dL/dq)^T [qd (L^T qd)^T]

where the last is one adjoint pass through L. Both passes are written out, so that they are differentiable.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Self, get_args

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from structlearn.networks.stacked_layers import StackedLayers
from structlearn.networks.torch_settings import Adam, AdamParameters, as_tensor
from structlearn.rigid_body.friction import (
    FrictionTerm,
    friction_coefficients,
    friction_columns,
    initial_friction,
)
from structlearn.rigid_body.motion import Motion

NetworkKind = Literal["mlp", "mlp_scaled", "delan"]
NETWORKS: tuple[NetworkKind, ...] = get_args(NetworkKind)

EVALUATED_AT_ONCE = 1024  # samples; larger batches leave the processor's cache
SUMMED_AT_ONCE = 4096  # samples; fixed, because the order of summation decides the last digits

SCALING = ("input_mean", "input_scale", "output_mean", "output_scale")
"""Tensors that all models of a stack share."""


@dataclass(frozen=True)
class StackedPerceptrons:
    """M networks from (q, qd, qdd) to torques."""

    network: StackedLayers  # of 3 n inputs and n outputs
    input_mean: Tensor  # (3 n,) subtracted from the inputs
    input_scale: Tensor  # (3 n,) divides the inputs
    output_mean: Tensor  # (n,) N m
    output_scale: Tensor  # (n,) N m

    @classmethod
    def initial(cls, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]) -> Self:
        """Untrained networks without standardisation, one per generator."""
        scaling = [plain(size) for size in (3 * joints, joints) for plain in (torch.zeros, torch.ones)]
        return cls(StackedLayers.uniform((3 * joints, *hidden, joints), generators), *scaling)

    def standardised(self, states: Sequence[Tensor], torque: Tensor) -> Self:
        """The networks with standardised inputs and outputs (the dissertation's have none).

        Means and scales are those of positions, velocities, accelerations and torques, (n, N) each.
        """
        scales: list[Tensor] = []
        for values in (torch.cat(list(states)), torque):
            scale = values.std(dim=1, correction=0)
            scales += [values.mean(dim=1), torch.where(scale > 0.0, scale, 1.0)]  # constant rows: 1
        return type(self)(self.network, *scales)

    def parameters(self) -> list[Tensor]:
        """Trained parameters."""
        return self.network.parameters()

    def torques(self, q: Tensor, qd: Tensor, qdd: Tensor) -> Tensor:
        """Torques (M, n, B) in N m at states (n, B), the same for all models, or (M, n, B)."""
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


SMALLEST_INERTIA = 1e-3  # kg m^2 (b): keeps H positive definite for all weights


@dataclass(frozen=True)
class StackedLagrangianNetworks:
    """M deep Lagrangian networks.

    L is lower triangular. A network outputs its n (n + 1) / 2 entries, diagonal first; the diagonal passes
    through a softplus, so that L is unique for every H.
    """

    inertia: StackedLayers  # gives the entries of L
    potential: StackedLayers  # gives V
    row: Tensor  # (entries, n) one-hot row of each entry; a product with it sums over the matrix
    column: Tensor  # (entries, n) one-hot column

    @classmethod
    def initial(cls, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]) -> Self:
        """Untrained networks, one per generator; both have the same hidden layers."""
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
        """Torques (M, n, B) in N m at states (n, B), the same for all models, or (M, n, B)."""
        q, rate = (values.expand(self.inertia.models, -1, -1) for values in (q, qd))
        values = self.inertia.activations(q)
        factor, slope = self._factor(self.inertia.output(values[-1]))
        factor_rate = slope * _tangent(self.inertia, values, rate)

        row_velocity, row_acceleration = self.row @ qd, self.row @ qdd
        momentum = self.column @ (self.column.mT @ (factor * row_velocity))  # L^T qd at each entry's column
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
        """Entries of L (M, entries, B) and their derivatives by the network's outputs."""
        diagonal, below = raw[:, : self.joints], raw[:, self.joints :]
        factor = torch.cat([functional.softplus(diagonal), below], dim=1)
        return factor, torch.cat([torch.sigmoid(diagonal), torch.ones_like(below)], dim=1)


def _tangent(network: StackedLayers, values: Sequence[Tensor], direction: Tensor) -> Tensor:
    """Directional derivative (M, K, B) of a network's outputs along a direction (M, D, B) of its inputs."""
    for value, weights in zip(values, network.weights[:-1], strict=True):
        direction = _times_tanh_slope(torch.bmm(weights, direction), value)
    return torch.bmm(network.weights[-1], direction)


def _adjoint(network: StackedLayers, values: Sequence[Tensor], cotangent: Tensor) -> Tensor:
    """Vector-Jacobian product (M, D, B): gradient of cotangent (M, K, B) . outputs by the inputs."""
    for value, weights in zip(reversed(values), reversed(network.weights[1:]), strict=True):
        cotangent = _times_tanh_slope(torch.bmm(weights.mT, cotangent), value)
    return torch.bmm(network.weights[0].mT, cotangent)


def _times_tanh_slope(factor: Tensor, value: Tensor) -> Tensor:
    """Factor (1 - value^2), by torch's kernel of tanh's gradient, itself differentiable, in one call."""
    return torch.ops.aten.tanh_backward(factor, value)


class NetworkLearner:
    """M networks of one kind, trained together in single precision, with a generator each for the start.

    `mlp` learns raw states and torques, as in the dissertation, `mlp_scaled` standardised ones; `delan` has
    friction terms, which perceptrons do not need. All learn from one motion, or each from its own motion of N
    samples (not `mlp_scaled`, which has one set of scales). `weights` (1 or M, n) scale each joint's squared
    error in the loss.
    """

    def __init__(
        self,
        kind: NetworkKind,
        motions: Sequence[Motion],
        friction: Sequence[FrictionTerm],
        weights: np.ndarray,
        adam: AdamParameters,
        hidden: Sequence[int],
        generators: Sequence[torch.Generator],
    ):
        joints = motions[0].joints
        self.terms = tuple(friction) if kind == "delan" else ()
        self.states = _by_columns(np.stack([motion.q, motion.qd, motion.qdd]) for motion in motions)
        self.torque = _by_columns(motion.torque for motion in motions)  # (R, n, N) with R = 1 or M
        self.columns = as_tensor(
            np.stack(
                [np.moveaxis(friction_columns(motion.q, motion.qd, self.terms), 0, -1) for motion in motions]
            )
        )  # (R, n, t, N)
        self.variance = np.stack([motion.torque_variance for motion in motions])
        self.network: StackedLagrangianNetworks | StackedPerceptrons
        if kind == "delan":
            self.network = StackedLagrangianNetworks.initial(joints, hidden, generators)
        else:
            self.network = StackedPerceptrons.initial(joints, hidden, generators)
            if kind == "mlp_scaled":
                self.network = self.network.standardised(list(self.states[0]), self.torque[0])
        self.friction = as_tensor(initial_friction(len(generators), joints, self.terms))
        self.parameters = [*self.network.parameters(), self.friction.requires_grad_()]
        self.optimiser = Adam(self.parameters, adam.rate, adam.second_moment_decay)
        self.samples, self.batch = len(motions[0]), adam.batch
        self.weights = as_tensor(weights)[..., None]

    def learn(self, order: Tensor) -> None:
        """Adam steps on the mean weighted squared error, one per batch of samples in the given order."""
        shuffled = (values[..., order].split(self.batch, dim=-1) for values in self._data)
        for states, torque, columns in zip(*shuffled, strict=True):
            torques = self._torques(states, columns)
            slope = (torques.detach() - torque) * (2.0 / torque.shape[-1] * self.weights)
            self.optimiser.step(torch.autograd.grad(torques, self.parameters, slope, allow_unused=True))

    @torch.no_grad()
    def nmse(self, stride: int = 1) -> np.ndarray:
        """NMSE (M, n) on every `stride`-th sample of the motion."""
        squares, count = 0.0, self.torque[..., ::stride].shape[-1]
        every = (values[..., ::stride].split(SUMMED_AT_ONCE, dim=-1) for values in self._data)
        for states, torque, columns in zip(*every, strict=True):
            parts = (values.split(EVALUATED_AT_ONCE, dim=-1) for values in (states, columns))
            error = torch.cat(list(map(self._torques, *parts)), dim=-1) - torque
            squares = squares + error.double().square().sum(dim=-1).numpy()
        return squares / (count * self.variance)

    def keep(self, models: np.ndarray) -> None:
        """Keep only some models; (M,) mask."""
        kept = torch.from_numpy(models)
        if len(self.torque) > 1:
            self.states, self.torque, self.columns = (values[kept] for values in self._data)
            self.weights, self.variance = self.weights[kept], self.variance[models]
        self.optimiser.keep(kept)

    def state(self) -> dict[str, np.ndarray]:
        """Weights and free parameters of friction, with a leading axis of models; then the scales."""
        tensors = self.network.to_arrays() | {"friction": self.friction.detach()}
        return {name: values.numpy().copy() for name, values in tensors.items()}

    @property
    def _data(self) -> tuple[Tensor, Tensor, Tensor]:
        return self.states, self.torque, self.columns

    def _torques(self, states: Tensor, columns: Tensor) -> Tensor:
        """Torques (M, n, B) at states (R, 3, n, B) with friction columns (R, n, t, B)."""
        torques = self.network.torques(*states.unbind(1))
        if not self.terms:
            return torques
        coefficients = friction_coefficients(self.friction, self.terms)
        return torques + (columns * coefficients[..., None]).sum(dim=-2)


def _by_columns(values: Iterable[np.ndarray]) -> Tensor:
    """(R, ..., n, N) tensor of arrays (..., N, n)."""
    return as_tensor(np.stack([np.swapaxes(matrix, -1, -2) for matrix in values]))
