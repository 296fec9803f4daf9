"""Human-inspired coupling term: steering features and pruning regression (Rai et al. 2014).

    c_i = sum_q sum_(beta, k) theta_i,q,beta,k (R v)_i phi exp(-beta phi) exp(-k d)

for q = the obstacle's centre and its closest point. phi is the angle between v and the direction to q, d the
distance to it; R rotates v by 90 degrees away from q in their common plane. beta and k are on a grid;
Bayesian regression with automatic relevance determination, one per axis, prunes the weights it does not need.
The velocity is tau v, as in all features, so that slow and fast movements avoid alike.

The regression follows scikit-learn's, which passes over all samples in every iteration; here it uses their
moments.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from scipy.linalg import lapack

from structlearn.avoidance import features as columns
from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError

BETA_PER_RAD = tuple(np.geomspace(2.0, 20.0, 5) / np.pi)
"""Up to 20 / pi, Fajen and Warren's value, used by the first such coupling terms. The effect is largest at
phi = 1 / beta, 9 to 90 degrees."""

DECAY_PER_M = tuple(np.geomspace(1.0, 30.0, 5))  # k: the effect halves within 70 cm to 2 cm
ITERATIONS = 200  # of the regression, as in the dissertation

GAIN_TOLERANCE = 1e-3
"""The regression stops when all weights together change by less, relative to the target's size."""

PRUNED_PRECISION = 1e4  # prior precision above which a weight is pruned; in the same units
VAGUE = 1e-6  # shape and rate of the gamma priors of all precisions


@dataclass(frozen=True)
class HumanInspiredModels:
    """M models, e.g. one per scenario."""

    weights: np.ndarray  # (M, 3, F) by axis and feature: centre first, beta before k; 0 if pruned

    def __len__(self) -> int:
        return len(self.weights)

    def __call__(self, features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
        """Coupling terms (B, 3): by model b for sample b, or by a single model for all samples.

        Raises ValueError: there are several models, but not as many as samples.
        """
        if len(self) not in (1, len(features)):
            raise ValueError(f"{len(features)} samples for {len(self)} models")
        weights = np.broadcast_to(self.weights, (len(features), *self.weights.shape[1:]))
        return np.einsum("sif,sif->si", steering_features(features), weights)

    def take(self, index: np.ndarray | Sequence[int]) -> Self:
        """Models of the given indices, which may repeat."""
        return type(self)(self.weights[np.asarray(index)])


def steering_features(features: np.ndarray) -> np.ndarray:
    """Steering effects (..., 3 axes, 2 x 5 x 5) of features (..., 17); 0 where R v is undefined."""
    velocity = features[..., columns.SCALED_VELOCITY]
    closest = features[..., columns.TO_POINTS][..., :: columns.CLOSEST_POINTS]
    effects = [_steering(velocity, to) for to in (features[..., columns.TO_CENTRE], closest)]
    return np.concatenate(effects, axis=-1)


def fit_human_inspired(features: np.ndarray, target: np.ndarray) -> HumanInspiredModels:
    """Fit one model to features (S, 17) and coupling terms (S, 3) m. Raises InputError: under two samples."""
    if len(target) < 2:
        raise InputError(f"{len(target)} samples are too few for a regression")
    effects = steering_features(features)
    weights = np.zeros((3, effects.shape[2]))
    for axis in range(3):
        # scaled to unit size, since the regression prunes by the size of a weight
        sizes = np.sqrt(np.mean(effects[:, axis] ** 2, axis=0))
        size = float(np.sqrt(np.mean(target[:, axis] ** 2)))
        used = sizes > 0.0
        if not used.any() or size == 0.0:
            continue
        fitted = pruning_regression(effects[:, axis, used] / sizes[used], target[:, axis] / size)
        weights[axis, used] = fitted * size / sizes[used]
    return HumanInspiredModels(weights[None])


def pruning_regression(inputs: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Weights (F,) of pruning Bayesian regression, (S, F) -> (S,) (MacKay 1994, Tipping 2001)."""
    gram, moments, energy = inputs.T @ inputs, inputs.T @ target, target @ target
    kept, weights = np.arange(len(gram)), np.zeros(len(gram))
    decay, noise = np.ones(len(gram)), 1.0 / (target.var() + np.finfo(float).eps)  # precisions
    for iteration in range(ITERATIONS):
        before = weights
        weights, variance = _posterior(gram, moments, kept, decay, noise)
        error = energy - 2.0 * weights @ moments + weights @ gram @ weights
        determined = 1.0 - decay[kept] * variance
        decay[kept] = (determined + 2.0 * VAGUE) / (weights[kept] ** 2 + 2.0 * VAGUE)
        noise = (len(target) - determined.sum() + 2.0 * VAGUE) / (error + 2.0 * VAGUE)
        pruned = kept[decay[kept] >= PRUNED_PRECISION]
        kept, weights[pruned] = np.setdiff1d(kept, pruned, assume_unique=True), 0.0
        if not len(kept):
            return weights
        if iteration and np.abs(weights - before).sum() < GAIN_TOLERANCE:
            break
    return _posterior(gram, moments, kept, decay, noise)[0]


def write_human_inspired(models: Mapping[str, HumanInspiredModels], path: str | Path) -> None:
    """Publish named stacks as one safetensors file; tensors are called `<name>.weights`."""
    tensors = {f"{name}.weights": stack.weights for name, stack in models.items()}
    write_tensors(tensors, path, json.dumps({"human_inspired": sorted(models)}))


def read_human_inspired(path: str | Path) -> dict[str, HumanInspiredModels]:
    """Read the stacks of a file, by name. Raises InputError: it is another file."""
    tensors = read_tensors(path)
    with holding(path, "human-inspired models"):
        names = json.loads(read_description(path))["human_inspired"]
        return {name: HumanInspiredModels(tensors[f"{name}.weights"]) for name in names}


def _posterior(
    gram: np.ndarray, moments: np.ndarray, kept: np.ndarray, decay: np.ndarray, noise: float
) -> tuple[np.ndarray, np.ndarray]:
    """Posterior mean of all weights (F,), 0 if pruned, and variances of the kept ones (K,)."""
    factor, _ = lapack.dpotrf(noise * gram[np.ix_(kept, kept)] + np.diag(decay[kept]), lower=1)
    mean = np.zeros(len(gram))
    mean[kept] = noise * lapack.dpotrs(factor, moments[kept], lower=1)[0]
    return mean, np.square(lapack.dtrtri(factor, lower=1)[0]).sum(axis=0)


def _steering(velocity: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Effects (..., 3, 25) of a point in direction `to` (..., 3)."""
    speed = np.linalg.norm(velocity, axis=-1)
    distance = np.linalg.norm(to, axis=-1)
    along = np.einsum("...i,...i", velocity, to)
    across = to - (along / np.where(speed > 0.0, speed**2, 1.0))[..., None] * velocity
    offset = np.linalg.norm(across, axis=-1)
    defined = (speed > 0.0) & (offset > 1e-12 * distance)
    turned = -across * np.where(defined, speed / np.where(defined, offset, 1.0), 0.0)[..., None]  # R v
    angle = np.arctan2(offset * speed, along)
    grid_angle = angle[..., None] * np.exp(-np.array(BETA_PER_RAD) * angle[..., None])
    grid_distance = np.exp(-np.array(DECAY_PER_M) * distance[..., None])
    grid = (grid_angle[..., :, None] * grid_distance[..., None, :]).reshape(*angle.shape, -1)
    return turned[..., :, None] * grid[..., None, :]
