"""Gradient descent on the inertias of M models at once, by the regressor.

While the kinematics are fixed, torques are Y theta. The gradient at theta is a matrix product, and autograd
only carries it through the parameterisation: the recursive algorithm (`newton_euler`) gives the same, more
slowly.
"""

from collections.abc import Sequence

import numpy as np
import torch

from structlearn.networks.adam import Adam, AdamParameters
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_regressor
from structlearn.rigid_body.inertia_parameters import Structure, draw, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.torque_factors import TorqueFactors, torque_factors
from structlearn.rigid_body.tree import KinematicTree

INITIAL_FRICTION = 0.01
"""N m s/rad or N m; not 0, where the gradient of a square is 0."""


def initial_friction(models: int, joints: int, terms: Sequence[FrictionTerm]) -> torch.Tensor:
    """Free parameters (M, n, k) of friction at the start, offsets 0."""
    start = [0.0 if term == "offset" else INITIAL_FRICTION**0.5 for term in terms]
    return torch.tensor(start, dtype=torch.float64).repeat(models, joints, 1)


class MotionRegressor:
    """A motion as regressor, shared by all models that learn from it.

    Args:
        tree: kinematics of the robot.
        motion: N samples.
        symmetric: whether inertias are taken to be symmetric; nostr's are not.
        friction: terms of joint friction, columns after those of the links.
    """

    def __init__(
        self, tree: KinematicTree, motion: Motion, symmetric: bool, friction: Sequence[FrictionTerm]
    ):
        columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd, symmetric)
        if friction:
            columns = np.concatenate([columns, friction_regressor(motion.qd, friction)], axis=-1)
        self.factors: TorqueFactors = torque_factors(columns, motion.torque)
        self.columns = torch.from_numpy(columns)  # (N, n, P)
        self.torque = torch.tensor(motion.torque)  # a copy: what other processes share cannot be written


class StructuredLearner:
    """M models of one structure that learn from the same samples.

    Args:
        structure: of the inertias.
        regressor: the motion.
        friction: terms of the regressor.
        weights: (n,) of each joint's squared error in the loss.
        adam: the optimiser.
        generators: source of the initial values of each model.
    """

    def __init__(
        self,
        structure: Structure,
        regressor: MotionRegressor,
        friction: Sequence[FrictionTerm],
        weights: np.ndarray,
        adam: AdamParameters,
        generators: Sequence[torch.Generator],
    ):
        joints = regressor.torque.shape[1]
        self.structure, self.regressor, self.friction = structure, regressor, tuple(friction)
        self.symmetric = structure != "nostr"
        self.weights = torch.from_numpy(np.asarray(weights, dtype=float))
        free = draw(structure, joints, list(generators))
        self.steps = torch.ones(free.shape[-1], dtype=torch.float64)
        self.steps[0] = adam.mass_step
        self.scaled = (free / self.steps).requires_grad_()
        self.rubbing = initial_friction(len(free), joints, self.friction).requires_grad_()
        self.adam = Adam([self.scaled, *([self.rubbing] if self.friction else [])], adam)
        self.samples, self.batch = len(regressor.torque), adam.batch

    @property
    def free(self) -> torch.Tensor:
        """(M, n, k) free parameters of the inertias, differentiable."""
        return self.scaled * self.steps

    def theta(self) -> torch.Tensor:
        """(M, P) parameters of the regressor's columns, differentiable."""
        theta = link_parameters(link_inertias(self.structure, self.free), self.symmetric)
        if not self.friction:
            return theta
        return torch.cat([theta, friction_coefficients(self.rubbing, self.friction).flatten(1)], dim=1)

    def step(self, samples: torch.Tensor) -> None:
        """One step of Adam down the mean weighted squared error of some samples."""
        columns, torque = self.regressor.columns[samples], self.regressor.torque[samples]
        theta = self.theta()
        error = columns.flatten(0, 1) @ theta.detach().mT - torque.reshape(-1, 1)  # (B n, M)
        weighted = error * self.weights.repeat(len(samples))[:, None]
        slope = (2.0 / len(samples)) * (weighted.mT @ columns.flatten(0, 1))
        self.adam.step(torch.autograd.grad(theta, self.adam.variables, slope))

    def nmse(self, stride: int = 1) -> np.ndarray:
        """(M, n) errors on the whole motion; a stride would save nothing."""
        return self.regressor.factors.nmse(self.theta().detach().numpy())

    def state(self) -> dict[str, np.ndarray]:
        """Free parameters, each with a leading axis of models."""
        return {
            "inertia": self.free.detach().numpy().copy(),
            "friction": self.rubbing.detach().numpy().copy(),
        }
