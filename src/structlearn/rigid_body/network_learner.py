"""Gradient descent on the weights of M networks at once: perceptrons and deep Lagrangian networks."""

from collections.abc import Iterable, Sequence
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor

from structlearn.networks.torch_settings import AdamParameters, as_tensor
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.inertia_learner import initial_friction
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.network_models import StackedLagrangianNetworks, StackedPerceptrons

NetworkKind = Literal["mlp", "mlp_scaled", "delan"]
NETWORKS: tuple[NetworkKind, ...] = get_args(NetworkKind)

EVALUATED_AT_ONCE = 4096
"""Samples; more would leave the processor's cache."""


class NetworkLearner:
    """M networks of one kind that learn together, in single precision.

    Args:
        kind: `mlp` on the plain states and torques, as in the dissertation; `mlp_scaled` on standardised
            ones; `delan`.
        motions: that all learn from, or one of N samples for each model; not for `mlp_scaled`, whose models
            have one scale.
        friction: terms of joint friction beside `delan`, which knows none; the perceptrons need none.
        weights: (1 or M, n) of each joint's squared error in the loss.
        adam: the optimiser.
        hidden: nodes of each hidden layer.
        generators: source of the initial values of each model.
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
        self.friction = tuple(friction) if kind == "delan" else ()
        self.states = _by_columns(np.stack([motion.q, motion.qd, motion.qdd]) for motion in motions)
        self.torque = _by_columns(motion.torque for motion in motions)  # (R, n, N) with R = 1 or M
        self.columns = as_tensor(
            np.stack([np.moveaxis(friction_columns(motion.qd, self.friction), 0, -1) for motion in motions])
        )  # (R, n, t, N)
        self.variance = np.stack([motion.torque_variance for motion in motions])
        self.network: StackedLagrangianNetworks | StackedPerceptrons
        if kind == "delan":
            self.network = StackedLagrangianNetworks.initial(joints, hidden, generators)
        else:
            self.network = StackedPerceptrons.initial(joints, hidden, generators)
            if kind == "mlp_scaled":
                self.network = self.network.standardised(list(self.states[0]), self.torque[0])
        self.rubbing = as_tensor(initial_friction(len(generators), joints, self.friction))
        self.parameters = [*self.network.parameters(), self.rubbing]
        self.optimiser = torch.optim.Adam(
            [values.requires_grad_() for values in self.parameters],
            adam.rate,
            (0.9, adam.second_moment_decay),
            fused=True,
        )
        self.samples, self.batch = len(motions[0]), adam.batch
        self.weights = as_tensor(weights)[..., None]

    def learn(self, order: Tensor) -> None:
        """Steps of Adam down the mean weighted squared error of samples, a batch each."""
        shuffled = (values[..., order].split(self.batch, dim=-1) for values in self._data)
        for states, torque, columns in zip(*shuffled, strict=True):
            torques = self._torques(states, columns)
            slope = (torques.detach() - torque) * (2.0 / torque.shape[-1] * self.weights)
            self.optimiser.zero_grad()
            torques.backward(slope)
            self.optimiser.step()

    @torch.no_grad()
    def nmse(self, stride: int = 1) -> np.ndarray:
        """(M, n) errors on the whole motion, or on every `stride`-th sample of it."""
        squares, count = 0.0, self.torque[..., ::stride].shape[-1]
        every = (values[..., ::stride].split(EVALUATED_AT_ONCE, dim=-1) for values in self._data)
        for states, torque, columns in zip(*every, strict=True):
            error = self._torques(states, columns) - torque
            squares = squares + error.double().square().sum(dim=-1).numpy()
        return squares / (count * self.variance)

    def keep(self, models: np.ndarray) -> None:
        """Go on with some of the models, (M,) whether each is among them."""
        kept = torch.from_numpy(models)
        if len(self.torque) > 1:
            self.states, self.torque, self.columns = (values[kept] for values in self._data)
            self.weights, self.variance = self.weights[kept], self.variance[models]
        for values in self.parameters:
            values.grad, values.data = None, values.data[kept]
            moments = self.optimiser.state[values]
            moments.update({name: its[kept] for name, its in moments.items() if its.ndim})

    def state(self) -> dict[str, np.ndarray]:
        """Weights and free parameters of friction, each with a leading axis of models; then scales."""
        tensors = self.network.to_arrays() | {"friction": self.rubbing.detach()}
        return {name: values.numpy().copy() for name, values in tensors.items()}

    @property
    def _data(self) -> tuple[Tensor, Tensor, Tensor]:
        return self.states, self.torque, self.columns

    def _torques(self, states: Tensor, columns: Tensor) -> Tensor:
        """(M, n, B) of states (R, 3, n, B) and columns of friction (R, n, t, B)."""
        torques = self.network.torques(*states.unbind(1))
        if not self.friction:
            return torques
        coefficients = friction_coefficients(self.rubbing, self.friction)
        return torques + (columns * coefficients[..., None]).sum(dim=-2)


def _by_columns(values: Iterable[np.ndarray]) -> Tensor:
    """(R, ..., n, N) of arrays (..., N, n)."""
    return as_tensor(np.stack([np.swapaxes(its, -1, -2) for its in values]))
