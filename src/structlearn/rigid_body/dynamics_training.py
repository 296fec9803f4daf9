"""Training of inverse-dynamics models: shuffled epochs up to an error threshold, or one online pass.

Models of one kind train together, one per seed. The seed decides the initial parameters; all models see the
samples in the same order. Training of inertias is compiled: with fixed kinematics torques are Y theta, so
the gradient by theta is a matrix product, which `inertia_parameters` propagates to the free parameters.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pandas as pd
import torch
from pydantic import Field

from structlearn.core.compilation import numba
from structlearn.core.params import Parameters
from structlearn.networks.torch_settings import MEAN_DECAY, SMALLEST_ROOT, AdamParameters, seeded
from structlearn.rigid_body.friction import FrictionTerm, initial_friction, squared
from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    Structure,
    sample_parameters,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.network_models import NETWORKS, SCALING, NetworkKind, NetworkLearner
from structlearn.rigid_body.regressor import MotionRegressor
from structlearn.rigid_body.tree import KinematicTree

Kind = Literal[NetworkKind, Structure]
KINDS: tuple[Kind, ...] = (*NETWORKS, *STRUCTURES)

Loss = Literal["raw", "normalised"]
LOSSES: tuple[Loss, ...] = get_args(Loss)

SHARED = (*SCALING, "row", "column")
"""Tensors of a state that all models share."""


class LearningParameters(Parameters):
    """Parameters of learning a dynamics model."""

    hidden: tuple[int, ...] = Field(min_length=1)
    networks: AdamParameters
    structures: AdamParameters
    threshold: float = Field(gt=0)


class TrainingData:
    """A motion to learn from, and the friction terms to learn.

    Networks ignore the kinematics; all structures share one regressor, which is made once.
    """

    def __init__(self, tree: KinematicTree, motion: Motion, friction: tuple[FrictionTerm, ...] = ()):
        self.tree, self.motion, self.friction = tree, motion, friction
        self._regressors: dict[bool, MotionRegressor] = {}

    def regressor(self, symmetric: bool) -> MotionRegressor:
        """Regressor of the motion, for symmetric inertias or (nostr) for full ones."""
        if symmetric not in self._regressors:
            self._regressors[symmetric] = MotionRegressor(self.tree, self.motion, symmetric, self.friction)
        return self._regressors[symmetric]


class InertiaLearner:
    """M models of one structure, trained together on the same samples.

    `weights` (n,) scale each joint's squared error in the loss; each model has a generator for its start.
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
        self.free = sample_parameters(structure, joints, list(generators)).numpy().copy()  # (M, n, k)
        self.friction = initial_friction(len(self.free), joints, regressor.friction)
        self.moments = tuple(
            (np.zeros_like(values), np.zeros_like(values)) for values in (self.free, self.friction)
        )
        self.adam, self.batch, self.steps = adam, adam.batch, 0

    def learn(self, order: torch.Tensor) -> None:
        """Adam steps on the mean weighted squared error, one per batch of samples in the given order."""
        models = (self.structure, self.free, self.friction, self.squared)
        data = (self.regressor.columns, self.regressor.torque, self.weights)
        rates = (self.adam.rate, self.adam.second_moment_decay)
        _descend(models, self.moments, data, order.numpy(), self.batch, rates, self.steps)
        self.steps += -(-len(order) // self.batch)

    def nmse(self, stride: int = 1) -> np.ndarray:
        """NMSE (M, n) on the whole motion; the stride is ignored, since it would save nothing."""
        theta = structure_theta(self.structure, self.free, self.friction, self.squared)
        return self.regressor.factors.nmse(theta)

    def keep(self, models: np.ndarray) -> None:
        """Keep only some models; (M,) mask."""
        self.free, self.friction = self.free[models], self.friction[models]
        self.moments = tuple((mean[models], square[models]) for mean, square in self.moments)

    def state(self) -> dict[str, np.ndarray]:
        """Free parameters, each with a leading axis of models."""
        return {"inertia": self.free.copy(), "friction": self.friction.copy()}


Learner = InertiaLearner | NetworkLearner


@dataclass(frozen=True)
class TrainedModels:
    """Result of training M models."""

    state: dict[str, np.ndarray]  # each model's, when it reached the threshold or after the last epoch
    nmse: np.ndarray  # (E + 1, M, n) at the start and after each epoch; constant once a model has stopped
    epochs: np.ndarray  # (M,) epochs needed; 0 if the threshold was not reached

    def part(self, model: int) -> "TrainedModels":
        """One of the models."""
        chosen = slice(model, model + 1)
        state = {name: values if name in SHARED else values[chosen] for name, values in self.state.items()}
        return TrainedModels(state, self.nmse[:, chosen], self.epochs[chosen])


def loss_weights(loss: Loss, motion: Motion) -> np.ndarray:
    """Weight (n,) of each joint's squared error: 1 as in eq. III.2, or 1 / variance of its torque."""
    return np.ones(motion.joints) if loss == "raw" else 1.0 / motion.torque_variance


def learner(
    kind: Kind, data: TrainingData, loss: Loss, seeds: Sequence[int], parameters: LearningParameters
) -> Learner:
    """Untrained models of one kind, one per seed."""
    weights, generators = loss_weights(loss, data.motion), [seeded(seed) for seed in seeds]
    if kind in STRUCTURES:
        regressor = data.regressor(kind != "nostr")
        return InertiaLearner(kind, regressor, weights, parameters.structures, generators)
    assert kind in NETWORKS
    motions, adam, hidden = [data.motion], parameters.networks, parameters.hidden
    return NetworkLearner(kind, motions, data.friction, weights[None], adam, hidden, generators)


def shuffled_epochs(models: Learner, epochs: int) -> Iterator[int]:
    """Train in shuffled epochs, and yield the number of each (from 1) after it."""
    generator = seeded(0)
    for epoch in range(1, epochs + 1):
        models.learn(torch.randperm(models.samples, generator=generator))
        yield epoch


def learn_annealed(models: NetworkLearner, epochs: int) -> None:
    """Train in shuffled epochs, with a learning rate that falls to zero along a cosine."""
    heights = [1.0 + math.cos(math.pi * epoch / epochs) for epoch in range(epochs + 1)]
    for epoch in shuffled_epochs(models, epochs):
        models.optimiser.rate *= heights[epoch] / heights[epoch - 1]


def learn_in_epochs(
    models: Learner, threshold: float, epochs: int, stride: int = 1, futility: int | None = None
) -> TrainedModels:
    """Train in shuffled epochs until every joint of every model is good enough (III.4.1.1).

    A model stops after the first epoch with an NMSE of at most `threshold` on every joint, or when the
    progress of the last `futility` epochs shows that it cannot get there (`_stopping`). Networks are checked
    on every `stride`-th sample first, and on all samples if that looks good enough.
    """
    errors = models.nmse(stride)
    history, kept = [errors], models.state()
    needed, learning = np.zeros(len(errors), dtype=int), np.arange(len(errors))
    for epoch in shuffled_epochs(models, epochs):
        before = history[epoch - futility][learning] if futility and epoch >= futility else None
        ahead = (epochs - epoch) / (futility or 1)
        nmse = models.nmse(stride)
        if epoch == epochs or _stopping(nmse, before, ahead, threshold).any():
            nmse = models.nmse()
        done = _stopping(nmse, before, ahead, threshold) | (epoch == epochs)
        errors = errors.copy()
        errors[learning] = nmse
        history.append(errors)
        needed[learning[_good(nmse, threshold)]] = epoch
        if done.any():
            for name, values in models.state().items():
                if name not in SHARED:
                    kept[name][learning[done]] = values[done]
            if done.all():
                break
            models.keep(~done)
            learning = learning[~done]
    return TrainedModels(kept, np.array(history), needed)


def learn_online(models: Learner, stride: int = 1) -> np.ndarray:
    """Train online: one pass through the motion in the order of time (III.4.1.2, figure III.2).

    Takes one step per batch. Returns the NMSE (E + 1, M, n) at the start and after each batch; networks are
    evaluated on every `stride`-th sample.
    """
    history = [models.nmse(stride)]
    for batch in torch.arange(models.samples).split(models.batch):
        models.learn(batch)
        history.append(models.nmse(stride))
    return np.array(history)


def epoch_errors(nmse: np.ndarray, step: str) -> pd.DataFrame:
    """Rows `seed`, `step`, `joint` (from 1) and `nmse` of errors (E, M, n)."""
    steps, seeds, joints = (places.ravel() for places in np.indices(nmse.shape))
    return pd.DataFrame({"seed": seeds, step: steps, "joint": joints + 1, "nmse": nmse.ravel()})


def _good(errors: np.ndarray, threshold: float) -> np.ndarray:
    """(M,) mask: every joint's error (M, n) is at most the threshold."""
    return np.all(errors <= threshold, axis=1)


def _stopping(errors: np.ndarray, before: np.ndarray | None, ahead: float, threshold: float) -> np.ndarray:
    """(M,) mask: every joint's error (M, n) is good enough, or not expected to become so.

    Errors are extrapolated: they keep falling as they did since `before` (M, n), for `ahead` times as long.
    """
    if before is None:
        return _good(errors, threshold)
    return np.all((errors <= threshold) | (errors * (errors / before) ** ahead > threshold), axis=1)


@numba.njit(cache=True)
def _descend(
    models: tuple, moments: tuple, data: tuple, order: np.ndarray, batch: int, rates: tuple, steps: int
) -> None:
    """Update the models by one Adam step per batch of the order.

    `models`: structure, then the other arguments of `structure_theta`; `moments`: Adam's two moments of the
    free parameters of inertias, then of friction; `data`: columns, torques and joint weights; `rates`:
    learning rate and decay of the second moment; `steps`: steps taken before.
    """
    structure, free, friction, squared = models
    columns, torque, weights = data
    for step in range(-(-len(order) // batch)):
        samples = order[step * batch : (step + 1) * batch]
        theta = structure_theta(structure, free, friction, squared)
        slope = np.zeros_like(theta)
        _add_slopes(columns, torque, 2.0 / len(samples) * weights, samples, free.shape[2], theta, slope)
        inertial, frictional = structure_gradient(structure, free, friction, squared, slope)
        _adam_step(free, inertial, moments[0], rates, steps + step + 1)
        _adam_step(friction, frictional, moments[1], rates, steps + step + 1)


@numba.njit(cache=True, error_model="numpy")  # no check for division by zero, so the loop vectorises
def _adam_step(variable: np.ndarray, gradient: np.ndarray, moments: tuple, rates: tuple, count: int) -> None:
    """One step of Adam in place, by torch's rule; `count` is the number of this step, from 1."""
    rate, decay = rates
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
    """Add Y^T weights (Y theta - tau) of some samples to the gradient of every model.

    A joint's torque does not depend on links before it, nor on the friction of other joints.
    """
    joints = torque.shape[1]
    links = joints * width
    terms = theta.shape[1] // joints - width
    for sample in samples:
        for joint in range(joints):
            begin, first = joint * width, links + joint * terms
            row, friction = columns[sample, joint, begin:links], columns[sample, joint, first : first + terms]
            for model in range(len(theta)):
                # views, so that the compiler vectorises
                values, slopes = theta[model, begin:links], slope[model, begin:links]
                coefficients = theta[model, first : first + terms]
                friction_slopes = slope[model, first : first + terms]
                error = -torque[sample, joint]
                for place in range(len(row)):
                    error += row[place] * values[place]
                for place in range(terms):
                    error += friction[place] * coefficients[place]
                error *= weights[joint]
                for place in range(len(row)):
                    slopes[place] += row[place] * error
                for place in range(terms):
                    friction_slopes[place] += friction[place] * error
