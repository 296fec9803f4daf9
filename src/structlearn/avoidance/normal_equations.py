"""Normal equations of the squared error of a feed-forward network: J^T J without J.

The Jacobian of 1000 samples and three outputs by 603 weights is never made. Of layer l, output o and sample s
its entries are h_si d_soj, an activation times a backpropagated slope, so that

    (J^T J)_{(l i j)(m k n)} = sum_s (h_si h_sk) (sum_o d_soj d_son)

is one matrix product per pair of layers, with the outputs summed before and symmetric halves left out: an
eighth of the operations of forming J and multiplying. Single precision would be twice as fast, but it limits
how far damping can fall: trainings end elsewhere, and what they are good for changes as with another seed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from structlearn.avoidance.avoidance_network import Layers, forward

CHUNK_SAMPLES = 256
"""Products of activations of so many samples stay in a core's cache."""


@dataclass(frozen=True)
class Samples:
    """Scaled inputs (S, D) and targets (S, O) of one network."""

    inputs: np.ndarray
    target: np.ndarray

    def where(self, mask: np.ndarray) -> "Samples":
        """The samples of a mask (S,) or of indices."""
        return Samples(self.inputs[mask], self.target[mask])


def normal_equations(layers: Layers, samples: Samples) -> tuple[np.ndarray, np.ndarray]:
    """J^T J and J^T e of the errors e = output - target with respect to all weights, layer by layer.

    `layers`: of one network, P weights in all. Returns (P, P), of which only the upper triangle is filled
    where blocks of layers are off the diagonal. (P,) half the gradient of the squared error.
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
    """What goes into each layer with a one for its biases, (S, before + 1) each, and the outputs (S, O)."""
    values, activations = inputs, []
    ones = np.ones((len(inputs), 1))
    for place, layer in enumerate(layers):
        activations.append(np.hstack([values, ones]))
        values = activations[-1] @ layer
        if place < len(layers) - 1:
            values = np.maximum(values, 0.0)
    return activations, values


def _slopes(layers: Layers, activations: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Derivatives of the outputs by what each layer adds up, (S, O, after) each."""
    samples, outputs = len(activations[0]), layers[-1].shape[1]
    slopes = [np.broadcast_to(np.eye(outputs), (samples, outputs, outputs))]
    for layer, values in zip(layers[:0:-1], activations[:0:-1], strict=True):
        active = values[:, None, :-1] > 0.0
        slopes.insert(0, (slopes[0] @ layer[:-1].T) * active)
    return slopes


def _products(first: np.ndarray, second: np.ndarray, halved: bool) -> np.ndarray:
    """Products of all pairs of rows (pairs, S); of the upper triangle only, if halved."""
    if halved:
        rows, columns = _upper(len(first))
        return first[rows] * first[columns]
    return (first[:, None] * second).reshape(-1, first.shape[1])


def _unfolded(block: np.ndarray, first: tuple[int, int], second: tuple[int, int]) -> np.ndarray:
    """Block (pairs of inputs, pairs of nodes) as a block of J^T J: (weights of one layer, of another)."""
    if block.size == first[0] * second[0] * first[1] * second[1]:
        full = block.reshape(first[0], second[0], first[1], second[1]).transpose(0, 2, 1, 3)
        return full.reshape(first[0] * first[1], second[0] * second[1])
    return block.ravel().take(_folded(first))


@cache
def _folded(shape: tuple[int, int]) -> np.ndarray:
    """Place of each pair of weights (P, P) of a layer in its block of halved pairs."""
    inputs, nodes = (_triangle(size) for size in shape)
    places = inputs[:, None, :, None] * (nodes.max() + 1) + nodes[None, :, None, :]
    return places.reshape(shape[0] * shape[1], -1)


@cache
def _upper(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the upper triangle of a matrix (size, size)."""
    return np.triu_indices(size)


def _triangle(size: int) -> np.ndarray:
    """Place of each pair (size, size) among those of the upper triangle, whichever comes first."""
    places = np.zeros((size, size), dtype=int)
    rows, columns = _upper(size)
    places[rows, columns] = np.arange(len(rows))
    return np.maximum(places, places.T)
