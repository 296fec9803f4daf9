"""The phase-modulated network compiled for loops: in the controller's tick, or for a batch of unrolls.

A network is packed into one vector, and its two linear last layers are folded with the phase features, which
depend on time only:

    c = w_c . (G * (W_m h + b_m)) = r . h + s        r = W_m^T (G * w_c)        s = b_m . (G * w_c)

So a step costs the hidden layers and one scalar product. `pmnn` is the reference.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numba
import numpy as np

from structlearn.feedback.pmnn import PhaseModulatedNetwork


class PackedNetworks(NamedTuple):
    """Hidden layers of several networks in a row.

    Attributes:
        values: all numbers; of each network mean (D,), scale (D,), then per layer W^T and b.
        first: (P,) where each network begins in `values`; -1 for none.
        layers: (P,) number of hidden layers.
        sizes: (P, L + 1) inputs, then width of each hidden layer.
    """

    values: np.ndarray
    first: np.ndarray
    layers: np.ndarray
    sizes: np.ndarray


def pack(networks: Sequence[PhaseModulatedNetwork | None]) -> PackedNetworks:
    """Pack networks, one per primitive or None."""
    present = [network for network in networks if network is not None]
    depth = max((len(network.hidden) for network in present), default=0)
    values, first = [np.empty(0)], np.full(len(networks), -1)
    layers = np.zeros(len(networks), dtype=np.int64)
    sizes = np.zeros((len(networks), depth + 1), dtype=np.int64)
    for index, network in enumerate(networks):
        if network is None:
            continue
        first[index] = sum(map(len, values))
        layers[index] = len(network.hidden)
        sizes[index, : len(network.hidden) + 1] = layer_sizes(network)
        values += [network.input_mean, network.input_scale]
        for weights, biases in network.hidden:
            values += [np.ravel(weights.T), biases]  # an input's weights side by side: the loop vectorises
    flat = np.concatenate(values).astype(float)
    return PackedNetworks(flat, first, layers, sizes)


def scratch(sizes: np.ndarray) -> np.ndarray:
    """Memory (2, W) for the layers of networks of these sizes (P, L + 1)."""
    return np.zeros((2, sizes.max(initial=1)))


def layer_sizes(network: PhaseModulatedNetwork) -> list[int]:
    """Number of inputs, then the width of each hidden layer."""
    return [len(network.input_mean), *(len(biases) for _, biases in network.hidden)]


def readout(network: PhaseModulatedNetwork, modulation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What turns the last hidden layer into the coupling term at given phases.

    Args:
        network: the network, last hidden layer of width H (the inputs, if it has none).
        modulation: (..., N) phase features.

    Returns:
        r: (..., H).   s: (...), so that c = r . h + s.
    """
    weights = modulation * network.output_weights
    return weights @ network.phase_weights, weights @ network.phase_biases


def compiled_coupling(
    network: PhaseModulatedNetwork,
) -> Callable[[np.ndarray, np.ndarray], np.ndarray | float]:
    """`network.coupling` for a loop over steps, without most of numpy's overhead.

    One movement is evaluated by compiled code; for a batch numpy's matrix products are faster, and what is
    saved is the linear last layers, folded once per step instead of once per movement.

    Args:
        network: the network, with D inputs and N phase features.

    Returns:
        Function of float deviations (..., D) and modulation (N,), common to the batch, that returns c (...).
    """
    packed = pack([network])
    arguments = (packed.values, int(packed.layers[0]), packed.sizes[0], scratch(packed.sizes))
    last = (network.phase_weights, network.phase_biases, network.output_weights)
    last = tuple(np.array(array, dtype=float, order="C") for array in last)

    def coupling(deviation: np.ndarray, modulation: np.ndarray) -> np.ndarray | float:
        if deviation.ndim == 1:
            return _coupling(deviation, modulation, *arguments, *last)
        layer = (deviation - network.input_mean) / network.input_scale
        for weights, biases in network.hidden:
            layer = layer @ weights.T
            layer += biases
            np.tanh(layer, out=layer)
        scale, offset = readout(network, modulation)
        return layer @ scale + offset

    return coupling


def stacked_readouts(
    networks: Mapping[int, PhaseModulatedNetwork], modulations: Mapping[int, np.ndarray], rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Readouts of the networks of consecutive primitives in one table.

    Args:
        networks: by the primitive's index.
        modulations: (T_i, N) phase features of those primitives.
        rows: (P + 1,) first row of each primitive in the table.

    Returns:
        r: (R, H) padded to the widest network.   s: (R,).   Zero where a primitive has no network.
    """
    width = max((network.phase_weights.shape[1] for network in networks.values()), default=0)
    scales, offsets = np.zeros((rows[-1], width)), np.zeros(rows[-1])
    for index, network in networks.items():
        r, s = readout(network, modulations[index])
        scales[rows[index] : rows[index + 1], : r.shape[1]] = r
        offsets[rows[index] : rows[index + 1]] = s
    return scales, offsets


@numba.njit(cache=True, fastmath={"contract"})
def hidden_layers(
    values: np.ndarray, begin: int, layers: int, sizes: np.ndarray, deviation: np.ndarray, work: np.ndarray
) -> int:
    """Write the last hidden layer, or the standardised input, into a row of work; return which row."""
    inputs = sizes[0]
    for i in range(inputs):
        work[0, i] = (deviation[i] - values[begin + i]) / values[begin + inputs + i]
    here, at = 0, begin + 2 * inputs
    for layer in range(layers):
        inputs, width = sizes[layer], sizes[layer + 1]
        biases = at + inputs * width
        layer_in, layer_out = work[here], work[1 - here]
        for j in range(width):
            layer_out[j] = values[biases + j]
        for i in range(inputs):
            value, weights = layer_in[i], values[at + i * width : at + (i + 1) * width]
            for j in range(width):
                layer_out[j] += weights[j] * value
        for j in range(width):  # tanh, three times faster than the library's and as good beside 1
            layer_out[j] = 1.0 - 2.0 / (math.exp(2.0 * layer_out[j]) + 1.0)
        here, at = 1 - here, biases + width
    return here


@numba.njit(cache=True, fastmath={"contract"})
def _coupling(
    deviation: np.ndarray,
    modulation: np.ndarray,
    values: np.ndarray,
    layers: int,
    sizes: np.ndarray,
    work: np.ndarray,
    phase_weights: np.ndarray,
    phase_biases: np.ndarray,
    output_weights: np.ndarray,
) -> float:
    """Coupling term of one deviation (D,)."""
    last, width, c = hidden_layers(values, 0, layers, sizes, deviation, work), sizes[layers], 0.0
    features, scale = work[last], work[1 - last]
    for j in range(width):
        scale[j] = 0.0
    for n in range(len(modulation)):
        weight, weights = modulation[n] * output_weights[n], phase_weights[n]
        c += weight * phase_biases[n]
        for j in range(width):
            scale[j] += weight * weights[j]
    for j in range(width):
        c += scale[j] * features[j]
    return c
