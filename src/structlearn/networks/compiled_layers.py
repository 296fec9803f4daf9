"""Compiled forward pass of a small network at a single sample, for control loops.

Networks are packed into one array, so that compiled code accepts any number of networks of any size.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from structlearn.core.compilation import numba

Array = np.ndarray  # in signatures of compiled functions

Layers = Sequence[tuple[np.ndarray, np.ndarray]]
"""Weights (after, before) and biases (after,) of each layer, e.g. `StackedLayers.layers_of`."""


class PackedNetworks(NamedTuple):
    """Several networks in one array."""

    values: np.ndarray  # per network mean (D,), scale (D,), then per layer W^T and b
    first: np.ndarray  # (P,) where each network begins in `values`
    sizes: np.ndarray  # (P, L + 1) inputs, then width of each layer


def pack(networks: Sequence[tuple[np.ndarray, np.ndarray, Layers]]) -> PackedNetworks:
    """Pack networks, each given by mean (D,) and scale (D,) of its inputs, and its layers."""
    sizes = np.zeros((len(networks), 1 + max(len(pairs) for *_, pairs in networks)), dtype=np.int64)
    values: list[np.ndarray] = []
    first = np.zeros(len(networks), dtype=np.int64)
    for index, (mean, scale, pairs) in enumerate(networks):
        first[index] = sum(map(len, values))
        sizes[index, : len(pairs) + 1] = [len(mean), *(len(biases) for _, biases in pairs)]
        values += [mean, scale]
        for weights, biases in pairs:
            values += [np.ravel(weights.T), biases]  # contiguous per input: the loop vectorises
    return PackedNetworks(np.concatenate(values).astype(float), first, sizes)


def layer_values(sizes: np.ndarray) -> np.ndarray:
    """Scratch memory (L + 2, W) for networks of sizes (P, L + 1): inputs, each layer, and a spare row."""
    return np.zeros((sizes.shape[1] + 1, sizes.max(initial=1)))


@numba.njit(cache=True, fastmath={"contract"})
def hidden_layers(values: Array, begin: int, layers: int, sizes: Array, inputs: Array, work: Array) -> int:
    """Write the standardised inputs (D,) and the activations of the tanh layers into rows of work.

    `values`: of packed networks; the network, of `sizes` (L + 1,), begins at `begin`. `work`: from
    `layer_values`; row k is for layer k. Returns where the next layer begins in `values`.
    """
    count = sizes[0]
    for i in range(count):
        work[0, i] = (inputs[i] - values[begin + i]) / values[begin + count + i]
    at = begin + 2 * count
    for layer in range(layers):
        out = work[layer + 1]
        at = affine(values, at, sizes[layer], sizes[layer + 1], work[layer], out)
        for j in range(sizes[layer + 1]):  # tanh, three times faster than the library's
            out[j] = 1.0 - 2.0 / (math.exp(2.0 * out[j]) + 1.0)
    return at


@numba.njit(cache=True, fastmath={"contract"})
def affine(values: Array, at: int, inputs: int, width: int, layer_in: Array, layer_out: Array) -> int:
    """Write W x + b of the layer that begins at `at`; return where the next layer begins."""
    biases = at + inputs * width
    for j in range(width):
        layer_out[j] = values[biases + j]
    even = inputs - inputs % 4
    for i in range(0, even, 4):  # four inputs at a time need a quarter of the memory accesses
        a, b, c, d = layer_in[i], layer_in[i + 1], layer_in[i + 2], layer_in[i + 3]
        rows = values[at + i * width : at + (i + 4) * width]
        for j in range(width):
            total = layer_out[j] + rows[j] * a
            total += rows[width + j] * b
            total += rows[2 * width + j] * c
            layer_out[j] = total + rows[3 * width + j] * d
    for i in range(even, inputs):
        value, row = layer_in[i], values[at + i * width : at + (i + 1) * width]
        for j in range(width):
            layer_out[j] += row[j] * value
    return biases + width


@numba.njit(cache=True, forceinline=True)
def last_hidden(sizes: Array, values: Array, inputs: Array, memory: Array) -> Array:
    """Activations of the last tanh layer of a network; its standardised inputs if it has no layer.

    `sizes`: L, then the number of inputs and the width of each hidden layer. `values`: of a packed network.
    `memory`: at least (L + 2) * widest, overwritten; the result is a part of it.
    """
    layers = sizes[0]
    shape = sizes[1 : layers + 2]
    widest = shape.max()
    work = memory[: (layers + 2) * widest].reshape(layers + 2, widest)
    hidden_layers(values, 0, layers, shape, inputs, work)
    return work[layers, : shape[layers]]
