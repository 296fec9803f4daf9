"""Gradient descent on the weights of M networks at once: perceptrons and deep Lagrangian networks."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor

from structlearn.networks.adam import AdamParameters, adam_step
from structlearn.networks.torch_settings import as_tensor
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.inertia_learner import initial_friction, squared
from structlearn.rigid_body.lagrangian import StackedLagrangianNetworks
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.multilayer_perceptron import SCALING, StackedPerceptrons
from structlearn.rigid_body.network_gradients import LagrangianGradients, PerceptronGradients

NetworkKind = Literal["mlp", "mlp_scaled", "delan"]
NETWORKS: tuple[NetworkKind, ...] = get_args(NetworkKind)

EVALUATED_AT_ONCE = 4096
"""Samples; more would leave the processor's cache."""


class NetworkLearner:
    """M networks of one kind that learn from the same samples, in single precision.

    Args:
        kind: `mlp` on the plain states and torques, as in the dissertation; `mlp_scaled` on standardised
            ones; `delan`.
        motion: N samples.
        friction: terms of joint friction beside `delan`, which knows none; the perceptrons need none.
        weights: (n,) of each joint's squared error in the loss.
        adam: the optimiser.
        hidden: nodes of each hidden layer.
        generators: source of the initial values of each model.
    """

    def __init__(
        self,
        kind: NetworkKind,
        motion: Motion,
        friction: Sequence[FrictionTerm],
        weights: np.ndarray,
        adam: AdamParameters,
        hidden: Sequence[int],
        generators: Sequence[torch.Generator],
    ):
        joints, models = motion.joints, len(generators)
        states = np.stack([motion.q, motion.qd, motion.qdd], axis=1).astype(np.float32)  # (N, 3, n)
        self.torque, self.variance = motion.torque.astype(np.float32), motion.torque_variance
        self.states, self.friction = states, tuple(friction) if kind == "delan" else ()
        self.network: StackedLagrangianNetworks | StackedPerceptrons
        if kind == "delan":
            self.network = StackedLagrangianNetworks.initial(joints, hidden, generators)
        else:
            plain = StackedPerceptrons.initial(joints, hidden, generators)
            torque = torch.from_numpy(self.torque.T)
            scaled = kind == "mlp_scaled"
            self.network = plain.standardised(_by_columns(states), torque) if scaled else plain
        self.rubbing = as_tensor(initial_friction(models, joints, self.friction))
        self.numbers = _as_one([*self.network.parameters(), self.rubbing])
        self.moments = (np.zeros_like(self.numbers), np.zeros_like(self.numbers))
        self.samples, self.batch = len(motion), adam.batch
        self.adam, self.steps = adam, 0
        self.data: tuple[np.ndarray, ...]
        self.gradients: LagrangianGradients | PerceptronGradients
        if isinstance(self.network, StackedLagrangianNetworks):
            columns = friction_columns(motion.qd, self.friction).astype(np.float32)
            self.data = (states, self.torque, columns)
            entries = (self.network.row.argmax(dim=1).numpy(), self.network.column.argmax(dim=1).numpy())
            self.gradients = LagrangianGradients(joints, hidden, entries, squared(self.friction))
        else:
            mean, scale, out_mean, out_scale = (getattr(self.network, name).numpy() for name in SCALING)
            inputs = (states.reshape(len(states), -1) - mean) / scale
            self.data = (inputs, (self.torque - out_mean) / out_scale)
            weights = weights * out_scale**2
            self.gradients = PerceptronGradients(joints, hidden)
        self.weights = weights.astype(np.float32)

    def learn(self, order: Tensor) -> None:
        """Steps of Adam down the mean weighted squared error of samples, a batch each."""
        for samples in order.split(self.batch):
            batch = (values[samples.numpy()] for values in self.data)
            gradients = self.gradients(self.numbers, self.weights, *batch)
            self.steps += 1
            adam_step(
                self.numbers,
                gradients,
                self.moments,
                self.adam.rate,
                self.adam.second_moment_decay,
                self.steps,
            )

    @torch.no_grad()
    def nmse(self, stride: int = 1) -> np.ndarray:
        """(M, n) errors on the whole motion, or on every `stride`-th sample of it."""
        states, torque = self.states[::stride], self.torque[::stride]
        squares = np.zeros((len(self.numbers), len(self.variance)))
        for begin in range(0, len(states), EVALUATED_AT_ONCE):
            some = slice(begin, begin + EVALUATED_AT_ONCE)
            error = self.network.torques(*_by_columns(states[some])) - torch.from_numpy(torque[some].T)
            if self.friction:
                columns = as_tensor(friction_columns(states[some, 1], self.friction))
                coefficients = friction_coefficients(self.rubbing, self.friction)
                error += torch.einsum("njt,mjt->mjn", columns, coefficients)
            squares += error.double().square().sum(dim=-1).numpy()
        return squares / (len(states) * self.variance)

    def state(self) -> dict[str, np.ndarray]:
        """Weights and free parameters of friction, each with a leading axis of models; then scales."""
        tensors = self.network.to_arrays() | {"friction": self.rubbing}
        return {name: values.numpy().copy() for name, values in tensors.items()}


def _by_columns(states: np.ndarray) -> list[Tensor]:
    """Positions, velocities and accelerations (n, N) of (N, 3, n)."""
    return [torch.from_numpy(values) for values in np.ascontiguousarray(states.transpose(1, 2, 0))]


def _as_one(parameters: Sequence[Tensor]) -> np.ndarray:
    """All numbers of each model (M, V) in one array, of which the tensors become views."""
    numbers = torch.cat([values.detach().flatten(1) for values in parameters], dim=1)
    sizes = [values[0].numel() for values in parameters]
    for values, view in zip(parameters, numbers.split(sizes, dim=1), strict=True):
        values.data = view.unflatten(1, values.shape[1:])
    return numbers.numpy()
