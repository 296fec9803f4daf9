"""Levenberg-Marquardt for avoidance networks.

    w <- w - (b J^T J + (a + mu) I)^-1 (b J^T e + a w)

With 1000 samples an iteration takes 25 ms: 13 in `normal_equations` and 3 in each Cholesky factorisation of
the 603 x 603 matrix. Call overhead is small beside that, so networks are trained one by one, distributed over
processes: each stops independently, with its own number of samples.

There are two stopping rules. `validation` is MATLAB's trainlm (a = 0, b = 1): stop after some iterations
without improvement on validation samples, and keep the best. `evidence` needs no validation samples: weight
decay a and precision b are re-estimated after every step from the number of weights that the data determine
(MacKay 1992; Foresee & Hagan 1997, MATLAB's trainbr).

The Jacobian of 1000 samples and three outputs by 603 weights is never formed. For layer l, output o and
sample s its entries are h_si d_soj, an activation times a backpropagated slope, so that

    (J^T J)_{(l i j)(m k n)} = sum_s (h_si h_sk) (sum_o d_soj d_son)

is one matrix product per pair of layers, with outputs summed first and symmetric halves left out: an eighth
of the operations. Single precision would be twice as fast, but limits how far the damping can fall; results
then change as much as with another seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, PositiveInt
from scipy.linalg import LinAlgError, cho_factor, cho_solve, cholesky, lapack

from structlearn.avoidance.avoidance_network import Layers, forward
from structlearn.core.params import Parameters

CHUNK_SAMPLES = 256  # samples per chunk, so that products of activations fit into a core's cache

FIRST_DAMPING = 1e-3  # initial mu; tenfold less after an improvement, tenfold more until there is one
LARGEST_DAMPING = 1e10
SMALLEST_DAMPING = 1e-12  # below it, damping has no effect in double precision
DAMPING_FACTOR = 10.0
PATIENCE = 6  # for `validation`: iterations without improvement before stopping
VALIDATION_SHARE = 0.15  # for `validation`: of the training demonstrations or blocks of samples

SLOW_STEPS, TOLERANCE = 3, 1e-4
"""Training stops after this many consecutive steps that reduce the error by less than this share."""

WEIGHTS, SPLIT, SEEN = 0, 1, 2  # last number of a network's random streams
VALIDATION, EVIDENCE = "validation", "evidence"
FIRST_DECAY = 0.01  # for `evidence`: before the first estimate, relative to the precision

SETTLING_STEPS = 5
"""Steps before the first estimate: random weights explain nothing, and decay would remove them."""


class Samples(NamedTuple):
    """Scaled inputs (S, D) and targets (S, O) of one network."""

    inputs: np.ndarray
    target: np.ndarray


def normal_equations(layers: Layers, samples: Samples) -> tuple[np.ndarray, np.ndarray]:
    """J^T J (P, P) and J^T e (P,) for the errors e = output - target and all P weights, layer by layer.

    Among blocks of two different layers, only those above the diagonal are filled.
    """
    count = len(layers)
    starts = np.cumsum([0, *(layer.size for layer in layers)])
    pairs = [(first, second) for first in range(count) for second in range(first, count)]
    blocks: dict[tuple[int, int], Any] = dict.fromkeys(pairs, 0.0)
    gradient = np.zeros(starts[-1])
    for start in range(0, len(samples.inputs), CHUNK_SAMPLES):
        rows = slice(start, start + CHUNK_SAMPLES)
        activations, outputs = _activations(layers, samples.inputs[rows])
        slopes = _slopes(layers, activations)
        error = outputs - samples.target[rows]
        for place in range(count):
            back = np.einsum("soi,so->si", slopes[place], error)
            gradient[starts[place] : starts[place + 1]] += (activations[place].T @ back).ravel()
        columns = [np.ascontiguousarray(values.T) for values in activations]
        for first, second in pairs:
            nodes = slopes[second].shape[2]
            over_outputs = (slopes[first].transpose(0, 2, 1) @ slopes[second]).reshape(len(error), -1)
            inner = _products(columns[first], columns[second], halved=first == second)
            if first == second:
                over_outputs = over_outputs.take(np.ravel_multi_index(_upper(nodes), (nodes, nodes)), axis=1)
            blocks[first, second] += inner @ over_outputs
    products = np.zeros((starts[-1], starts[-1]))
    for first, second in pairs:
        rows, across = slice(*starts[first : first + 2]), slice(*starts[second : second + 2])
        products[rows, across] = _unfolded(blocks[first, second], layers[first].shape, layers[second].shape)
    return products, gradient


def squared_error(layers: Layers, samples: Samples) -> float:
    """Sum of squared errors over samples and outputs."""
    return float(np.square(forward(layers, samples.inputs) - samples.target).sum())


def _activations(layers: Layers, inputs: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Inputs of each layer with a one for the biases, (S, before + 1) each, and the outputs (S, O)."""
    values, activations = inputs, []
    ones = np.ones((len(inputs), 1))
    for place, layer in enumerate(layers):
        activations.append(np.hstack([values, ones]))
        values = activations[-1] @ layer
        if place < len(layers) - 1:
            values = np.maximum(values, 0.0)
    return activations, values


def _slopes(layers: Layers, activations: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Derivatives of the outputs by each layer's pre-activations, (S, O, after) each."""
    samples, outputs = len(activations[0]), layers[-1].shape[1]
    slopes = [np.broadcast_to(np.eye(outputs), (samples, outputs, outputs))]
    for layer, values in zip(layers[:0:-1], activations[:0:-1], strict=True):
        active = values[:, None, :-1] > 0.0
        slopes.insert(0, (slopes[0] @ layer[:-1].T) * active)
    return slopes


def _products(first: np.ndarray, second: np.ndarray, halved: bool) -> np.ndarray:
    """Products of all pairs of rows (pairs, S), or of the upper triangle only."""
    if halved:
        rows, columns = _upper(len(first))
        return first[rows] * first[columns]
    return (first[:, None] * second).reshape(-1, first.shape[1])


def _unfolded(block: np.ndarray, first: tuple[int, int], second: tuple[int, int]) -> np.ndarray:
    """Reorder a block (pairs of inputs, pairs of nodes) to a block of J^T J (weights, weights)."""
    if block.size == first[0] * second[0] * first[1] * second[1]:
        full = block.reshape(first[0], second[0], first[1], second[1]).transpose(0, 2, 1, 3)
        return full.reshape(first[0] * first[1], second[0] * second[1])
    return block.ravel().take(_folded(first))


@cache
def _folded(shape: tuple[int, int]) -> np.ndarray:
    """Index of each pair of weights (P, P) of a layer in its halved block."""
    inputs, nodes = (_triangle(size) for size in shape)
    places = inputs[:, None, :, None] * (nodes.max() + 1) + nodes[None, :, None, :]
    return places.reshape(shape[0] * shape[1], -1)


@cache
def _upper(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the upper triangle of a matrix (size, size)."""
    return np.triu_indices(size)


def _triangle(size: int) -> np.ndarray:
    """Index (size, size) of each symmetric pair in the list of upper-triangle entries."""
    places = np.zeros((size, size), dtype=int)
    rows, columns = _upper(size)
    places[rows, columns] = np.arange(len(rows))
    return np.maximum(places, places.T)


class LevenbergMarquardtParameters(Parameters):
    """Training of an avoidance network. Fields: `params.yaml`, `obstacle_training.per_setting.training`."""

    rule: Literal["validation", "evidence"]
    iterations: PositiveInt
    seed: int = Field(ge=0)


def initial_layers(sizes: Sequence[int], rng: np.random.Generator) -> list[np.ndarray]:
    """Random layers (before + 1, after): weights of variance 2 / before (for ReLU), small biases."""
    layers = []
    for before, after in pairwise(sizes):
        weights = rng.normal(size=(before, after)) * (2.0 / before) ** 0.5
        layers.append(np.vstack([weights, 0.1 * rng.normal(size=(1, after))]))
    return layers


def levenberg_marquardt(
    layers: Layers,
    samples: Samples,
    parameters: LevenbergMarquardtParameters,
    validation: Samples | None = None,
) -> tuple[np.ndarray, ...]:
    """Train one network from given layers, and return its layers.

    Raises ValueError: validation samples are missing, or given for the other rule.
    """
    if (parameters.rule == VALIDATION) != (validation is not None):
        raise ValueError(
            f"rule '{parameters.rule}': validation samples are for '{VALIDATION}' and needed there"
        )
    shapes = [layer.shape for layer in layers]
    weights = np.concatenate([layer.ravel() for layer in layers])
    error = squared_error(layers, samples)
    prior = _Prior(FIRST_DECAY, 1.0) if parameters.rule == EVIDENCE else _Prior(0.0, 1.0)
    best, best_error, failures, slow, iterations = weights, np.inf, 0, 0, 0
    damping = FIRST_DAMPING
    while iterations < parameters.iterations and slow < SLOW_STEPS and failures < PATIENCE:
        products, gradient = normal_equations(_layers(weights, shapes), samples)
        before = prior.objective(weights, error)
        step = _accepted_step(weights, before, products, gradient, samples, prior, shapes, damping)
        if step is None:
            break
        weights, error, damping = step
        iterations += 1
        slow = slow + 1 if prior.objective(weights, error) > (1.0 - TOLERANCE) * before else 0
        if parameters.rule == EVIDENCE and iterations >= SETTLING_STEPS:
            prior = prior.reestimated(products, weights, error, samples.target.size)
        if validation is not None:
            held_out = squared_error(_layers(weights, shapes), validation) / validation.target.size
            failures = 0 if held_out < best_error else failures + 1
            if failures == 0:
                best, best_error = weights, held_out
    return tuple(_layers(weights if validation is None else best, shapes))


@dataclass(frozen=True)
class _Prior:
    """Weights of the two terms of the objective (evidence framework)."""

    decay: float
    precision: float

    def objective(self, weights: np.ndarray, error: float) -> float:
        return self.precision * error + self.decay * float(weights @ weights)

    def reestimated(self, products: np.ndarray, weights: np.ndarray, error: float, count: int) -> "_Prior":
        """MacKay's estimates of decay and precision; unchanged if the matrix is not positive definite."""
        try:
            shifted = _shifted(self.precision * products, self.decay)
            factor = cholesky(shifted, lower=True, overwrite_a=True, check_finite=False)
        except LinAlgError:
            return self
        root, _ = lapack.dtrtri(factor, lower=1)
        determined = len(weights) - self.decay * float(np.square(root).sum())  # trace of the inverse
        left = max(count - determined, 1.0)
        return _Prior(determined / float(weights @ weights), left / error)


def _accepted_step(
    weights: np.ndarray,
    objective: float,
    products: np.ndarray,
    gradient: np.ndarray,
    samples: Samples,
    prior: _Prior,
    shapes: Sequence[tuple[int, ...]],
    damping: float,
) -> tuple[np.ndarray, float, float] | None:
    """New weights, their squared error and the next damping; None if no damping gives an improvement."""
    right = prior.precision * gradient + prior.decay * weights
    while damping <= LARGEST_DAMPING:
        shifted = _shifted(prior.precision * products, prior.decay + damping)
        try:
            factor = cho_factor(shifted, lower=True, overwrite_a=True, check_finite=False)
        except LinAlgError:
            damping *= DAMPING_FACTOR
            continue
        proposal = weights - cho_solve(factor, right, check_finite=False)
        error = squared_error(_layers(proposal, shapes), samples)
        if prior.objective(proposal, error) < objective:
            return proposal, error, max(damping / DAMPING_FACTOR, SMALLEST_DAMPING)
        damping *= DAMPING_FACTOR
    return None


def _shifted(matrix: np.ndarray, shift: float) -> np.ndarray:
    """Add a shift to the diagonal in place; returns the lower triangle in the library's memory layout."""
    matrix[np.diag_indices_from(matrix)] += shift
    return matrix.T


def _layers(weights: np.ndarray, shapes: Sequence[tuple[int, ...]]) -> list[np.ndarray]:
    """Layers of given shapes from a vector of weights (P,)."""
    ends = np.cumsum([np.prod(shape) for shape in shapes])
    return [part.reshape(shape) for part, shape in zip(np.split(weights, ends[:-1]), shapes, strict=True)]
