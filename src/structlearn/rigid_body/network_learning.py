"""Gradient descent on the weights of M networks at once: perceptrons and deep Lagrangian networks."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from structlearn.networks.adam import Adam, AdamParameters
from structlearn.networks.torch_settings import as_tensor
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.lagrangian import StackedLagrangianNetworks
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.multilayer_perceptron import StackedPerceptrons
from structlearn.rigid_body.structured_learning import initial_friction

NetworkKind = Literal["mlp", "mlp_scaled", "delan"]

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
        joints = motion.joints
        self.kind, self.friction = kind, tuple(friction) if kind == "delan" else ()
        network = StackedLagrangianNetworks if kind == "delan" else StackedPerceptrons
        self.network = network.initial(joints, hidden, generators)
        parts = [motion.q, motion.qd, motion.qdd, motion.torque]
        if self.friction:
            columns = friction_columns(motion.qd, self.friction)
            parts += [columns[..., term] for term in range(len(self.friction))]
        self.rows = as_tensor(np.hstack(parts))  # (N, n (4 + k)): a batch is a gathering of rows
        self.joints, self.variance = joints, motion.torque_variance
        if kind == "mlp_scaled":
            q, qd, qdd, torque = self.rows.mT.split(joints)
            self.network = self.network.standardised((q, qd, qdd), torque)
        self.weights = as_tensor(np.asarray(weights))[:, None]
        self.rubbing = as_tensor(initial_friction(len(generators), joints, self.friction)).requires_grad_()
        variables = [*self.network.parameters(), *([self.rubbing] if self.friction else [])]
        self.adam = Adam(variables, adam)
        self.samples, self.batch = len(motion), adam.batch

    def learn(self, order: Tensor) -> None:
        """Steps of Adam down the mean weighted squared error of samples, a batch each."""
        for samples in order.split(self.batch):
            error = self._error(self.rows[samples])
            loss = (error * error * self.weights).sum() / len(samples)
            self.adam.step(torch.autograd.grad(loss, self.adam.variables, allow_unused=True))

    @torch.no_grad()
    def nmse(self, stride: int = 1) -> np.ndarray:
        """(M, n) errors on the whole motion, or on every `stride`-th sample of it."""
        chunks = self.rows[::stride].split(EVALUATED_AT_ONCE)
        squares = sum(self._error(chunk).double().square().sum(dim=-1) for chunk in chunks)
        return squares.numpy() / (sum(map(len, chunks)) * self.variance)

    def state(self) -> dict[str, np.ndarray]:
        """Weights and free parameters of friction, each with a leading axis of models; then scales."""
        tensors = self.network.to_arrays() | {"friction": self.rubbing.detach()}
        return {name: values.numpy().copy() for name, values in tensors.items()}

    def _error(self, rows: Tensor) -> Tensor:
        """(M, n, B) torques too much."""
        q, qd, qdd, torque, *columns = rows.mT.contiguous().split(self.joints)
        error = self.network.torques(q, qd, qdd) - torque
        coefficients = friction_coefficients(self.rubbing, self.friction) if self.friction else self.rubbing
        for term, column in enumerate(columns):
            error = error + coefficients[..., term, None] * column
        return error
