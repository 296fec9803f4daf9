"""The phase-modulated network compiled for loops: in the controller's tick, or for a batch of unrolls.

Its hidden layers are `networks.compiled_layers`; its two linear last layers are folded with the phase
features, which depend on time only:

    c = w_c . (G * (W_m h + b_m)) = r . h + s        r = W_m^T (G * w_c)        s = b_m . (G * w_c)

So a step costs the hidden layers and one scalar product. `pmnn` is the reference.
"""

from collections.abc import Callable, Mapping, Sequence

import numba
import numpy as np

from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.networks.compiled_layers import PackedNetworks, hidden_layers, layer_values, pack


def packed_hidden(networks: Sequence[PhaseModulatedNetwork | None]) -> PackedNetworks:
    """Standardisation and hidden layers of networks, in their order; of those that are None nothing."""
    return pack(
        [
            None if network is None else (network.input_mean, network.input_scale, network.hidden)
            for network in networks
        ]
    )


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
    packed = packed_hidden([network])
    arguments = (packed.values, int(packed.layers[0]), packed.sizes[0], layer_values(packed.sizes))
    # One array instead of three: handing an array to compiled code takes as long as some hundred products.
    last = np.column_stack([network.output_weights, network.phase_biases, network.phase_weights])
    last = np.ascontiguousarray(last, dtype=float)

    def coupling(deviation: np.ndarray, modulation: np.ndarray) -> np.ndarray | float:
        if deviation.ndim == 1:
            return _coupling(deviation, modulation, *arguments, last)
        layer = (deviation - network.input_mean) / network.input_scale
        for weights, biases in network.hidden:
            layer = layer @ weights.T
            layer += biases
            np.tanh(layer, out=layer)
        scale, offset = readout(network, modulation)
        return layer @ scale + offset

    return coupling


def stacked_readouts(
    networks: Mapping[tuple[int, int], PhaseModulatedNetwork],
    modulations: Mapping[tuple[int, int], np.ndarray],
    rows: np.ndarray,
    axes: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Readouts of the networks of consecutive primitives in one table.

    Args:
        networks: by the index of the primitive and that of the axis.
        modulations: (T_i, N) phase features of those.
        rows: (P + 1,) first row of each primitive in the table.
        axes: their number D.

    Returns:
        r: (R, D, H) padded to the widest network.   s: (R, D).   Zero where there is no network.
    """
    width = max((network.phase_weights.shape[1] for network in networks.values()), default=0)
    scales, offsets = np.zeros((rows[-1], axes, width)), np.zeros((rows[-1], axes))
    for (index, place), network in networks.items():
        r, s = readout(network, modulations[index, place])
        scales[rows[index] : rows[index + 1], place, : r.shape[1]] = r
        offsets[rows[index] : rows[index + 1], place] = s
    return scales, offsets


@numba.njit(cache=True, fastmath={"contract"})
def _coupling(
    deviation: np.ndarray,
    modulation: np.ndarray,
    values: np.ndarray,
    layers: int,
    sizes: np.ndarray,
    work: np.ndarray,
    last: np.ndarray,
) -> float:
    """Coupling term of one deviation (D,); rows of last (N, 2 + H): output weight, phase bias and weights."""
    hidden_layers(values, 0, layers, sizes, deviation, work)
    features, scale, width, c = work[layers], work[layers + 1], sizes[layers], 0.0
    for j in range(width):
        scale[j] = 0.0
    for n in range(len(modulation)):
        weight = modulation[n] * last[n, 0]
        c += weight * last[n, 1]
        for j in range(width):
            scale[j] += weight * last[n, 2 + j]
    for j in range(width):
        c += scale[j] * features[j]
    return c
