"""Gradient descent on the inertias of M models at once, by the regressor, compiled.

While the kinematics are fixed, torques are Y theta. The gradient at theta is a matrix product, and
`inertia_parameters` carries it through the parameterisation: the recursive algorithm (`newton_euler`) and
autograd give the same, more slowly.
"""

import math
from collections.abc import Sequence

import numpy as np
import torch

from structlearn.core.compilation import numba
from structlearn.networks.torch_settings import AdamParameters
from structlearn.rigid_body.friction import SIGNED, FrictionTerm, friction_regressor
from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    Structure,
    draw,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import TorqueFactors, torque_factors, torque_regressor
from structlearn.rigid_body.tree import KinematicTree

INITIAL_FRICTION = 0.01
"""N m s/rad or N m; not 0, where the gradient of a square is 0."""

MEAN_DECAY, SMALLEST_ROOT = 0.9, 1e-8
"""Of Adam: decay of the running mean of gradients per step; added to the root of their mean square."""


def initial_friction(models: int, joints: int, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """Free parameters (M, n, t) of friction at the start, 0 for `SIGNED` terms."""
    return np.tile(np.where(squared(terms), INITIAL_FRICTION**0.5, 0.0), (models, joints, 1))


def squared(terms: Sequence[FrictionTerm]) -> np.ndarray:
    """(t,) whether the coefficient of a term is the square of its free parameter."""
    return np.array([term not in SIGNED for term in terms], dtype=bool)


class MotionRegressor:
    """A motion as regressor, shared by all models that learn from it.

    Inertias are taken to be symmetric, or, for nostr, not; columns of friction come after those of the links.
    """

    def __init__(
        self, tree: KinematicTree, motion: Motion, symmetric: bool, friction: Sequence[FrictionTerm]
    ):
        columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd, symmetric)
        if friction:
            columns = np.concatenate([columns, friction_regressor(motion.q, motion.qd, friction)], axis=-1)
        self.factors: TorqueFactors = torque_factors(columns, motion.torque)
        self.columns, self.torque = columns, motion.torque  # (N, n, P), (N, n)
        self.friction = tuple(friction)


class InertiaLearner:
    """M models of one structure that learn from the same samples.

    `weights` (n,) are those of each joint's squared error in the loss; a generator per model draws its start.
    """

    def __init__(
        self,
        structure: Structure,
        regressor: MotionRegressor,
        weights: np.ndarray,
        adam: AdamParameters,
        generators: Sequence[torch.Generator],
    ):
        self.samples, joints = regressor.torque.shape
        self.structure, self.regressor, self.weights = STRUCTURES.index(structure), regressor, weights
        self.squared = squared(regressor.friction)
        self.free = draw(structure, joints, list(generators)).numpy().copy()  # (M, n, k)
        self.rubbing = initial_friction(len(self.free), joints, regressor.friction)
        self.moments = [(np.zeros_like(its), np.zeros_like(its)) for its in (self.free, self.rubbing)]
        self.adam, self.batch, self.steps = adam, adam.batch, 0

    def learn(self, order: torch.Tensor) -> None:
        """Steps of Adam down the mean weighted squared error of samples, a batch each."""
        inertial_moments, rubbed_moments = self.moments
        _descend(
            self.structure,
            self.regressor.columns,
            self.regressor.torque,
            self.weights,
            order.numpy(),
            self.batch,
            self.free,
            self.rubbing,
            self.squared,
            inertial_moments,
            rubbed_moments,
            self.adam.rate,
            self.adam.second_moment_decay,
            self.steps,
        )
        self.steps += -(-len(order) // self.batch)

    def nmse(self, stride: int = 1) -> np.ndarray:
        """(M, n) errors on the whole motion; a stride would save nothing."""
        theta = structure_theta(self.structure, self.free, self.rubbing, self.squared)
        return self.regressor.factors.nmse(theta)

    def keep(self, models: np.ndarray) -> None:
        """Go on with some of the models, (M,) whether each is among them."""
        self.free, self.rubbing = self.free[models], self.rubbing[models]
        self.moments = [(mean[models], square[models]) for mean, square in self.moments]

    def state(self) -> dict[str, np.ndarray]:
        """Free parameters, each with a leading axis of models."""
        return {"inertia": self.free.copy(), "friction": self.rubbing.copy()}


@numba.njit(cache=True)
def _descend(
    structure: int,
    columns: np.ndarray,
    torque: np.ndarray,
    weights: np.ndarray,
    order: np.ndarray,
    batch: int,
    free: np.ndarray,
    rubbing: np.ndarray,
    squared: np.ndarray,
    inertial_moments: tuple[np.ndarray, np.ndarray],
    rubbed_moments: tuple[np.ndarray, np.ndarray],
    rate: float,
    decay: float,
    steps: int,
) -> None:
    """Change `free` and `rubbing`, and Adam's moments of both, by a step per batch of the order."""
    for step in range(-(-len(order) // batch)):
        samples = order[step * batch : (step + 1) * batch]
        theta = structure_theta(structure, free, rubbing, squared)
        slope = np.zeros_like(theta)
        _add_slopes(columns, torque, 2.0 / len(samples) * weights, samples, free.shape[2], theta, slope)
        inertial, rubbed = structure_gradient(structure, free, rubbing, squared, slope)
        _adam_step(free, inertial, inertial_moments, rate, decay, steps + step + 1)
        _adam_step(rubbing, rubbed, rubbed_moments, rate, decay, steps + step + 1)


@numba.njit(cache=True, error_model="numpy")  # without a check of each divisor it becomes vectors
def _adam_step(
    variable: np.ndarray,
    gradient: np.ndarray,
    moments: tuple[np.ndarray, np.ndarray],
    rate: float,
    decay: float,
    count: int,
) -> None:
    """One step of Adam in place, by torch's rule; `count` is the number of this step, from 1."""
    mean, square = moments[0].reshape(-1), moments[1].reshape(-1)
    values, slopes = variable.reshape(-1), gradient.reshape(-1)
    step, root = rate / (1.0 - MEAN_DECAY**count), math.sqrt(1.0 - decay**count)
    for place in range(len(values)):
        mean[place] += (1.0 - MEAN_DECAY) * (slopes[place] - mean[place])
        square[place] += (1.0 - decay) * (slopes[place] * slopes[place] - square[place])
        values[place] -= step * mean[place] / (math.sqrt(square[place]) / root + SMALLEST_ROOT)


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _add_slopes(
    columns: np.ndarray,
    torque: np.ndarray,
    weights: np.ndarray,
    samples: np.ndarray,
    width: int,
    theta: np.ndarray,
    slope: np.ndarray,
) -> None:
    """Add Y^T weights (Y theta - tau) of some samples, for every model.

    A joint's torque does not depend on links before it, nor on the friction of other joints.
    """
    joints = torque.shape[1]
    links = joints * width
    terms = theta.shape[1] // joints - width
    for sample in samples:
        for joint in range(joints):
            begin, rub = joint * width, links + joint * terms
            row, rubbed = columns[sample, joint, begin:links], columns[sample, joint, rub : rub + terms]
            for model in range(len(theta)):
                # views, which the compiler turns into vector instructions
                values, found = theta[model, begin:links], slope[model, begin:links]
                rubbing, its = theta[model, rub : rub + terms], slope[model, rub : rub + terms]
                error = -torque[sample, joint]
                for place in range(len(row)):
                    error += row[place] * values[place]
                for place in range(terms):
                    error += rubbed[place] * rubbing[place]
                error *= weights[joint]
                for place in range(len(row)):
                    found[place] += row[place] * error
                for place in range(terms):
                    its[place] += rubbed[place] * error
