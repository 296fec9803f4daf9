"""Compiled forward pass of tanh layers with a linear readout that may change with the phase: PMNN and FFNN.

Of a row of the table, the first number is the offset, the next are the readout of the last layer; what
follows are further inputs beside the deviations.

    h = tanh layers of [ds, row[1 + H :]]        c = row[0] + row[1 : 1 + H] . h
"""

from collections.abc import Sequence

import numba
import numpy as np

from structlearn.feedback.coupling_model import Compiled, kernel
from structlearn.networks.compiled_layers import hidden_layers, layer_values, pack


@kernel
def layered(sizes, values, row, deviations, memory):
    """C at one sample; see `layered_numbers`."""
    extra, layers = sizes[1], sizes[2]
    shape = numba.carray(sizes, 4 + layers)[3:]
    width, channels = 0, shape[0] - extra
    for size in shape:
        width = max(width, size)
    room = numba.carray(memory, (layers + 2) * width + shape[0])
    work = room[: (layers + 2) * width].reshape(layers + 2, width)
    inputs = numba.carray(deviations, shape[0])
    if extra:
        inputs = room[(layers + 2) * width :]
        for i in range(channels):
            inputs[i] = deviations[i]
        for i in range(extra):
            inputs[channels + i] = row[1 + shape[layers] + i]
    hidden_layers(numba.carray(values, sizes[0]), 0, layers, shape, inputs, work)
    last, c = work[layers], row[0]
    for j in range(shape[layers]):
        c += row[1 + j] * last[j]
    return c


def layered_numbers(
    mean: np.ndarray, scale: np.ndarray, hidden: Sequence[tuple[np.ndarray, np.ndarray]], extra: int = 0
) -> Compiled:
    """Numbers of a network for the kernel.

    Args:
        mean: (D + X,) taken off its inputs.
        scale: (D + X,) by which they are divided then.
        hidden: weights and biases of each tanh layer.
        extra: how many inputs X come from the row.
    """
    packed = pack([(mean, scale, hidden)])
    shape = packed.sizes[0]
    sizes = np.array([len(packed.values), extra, len(hidden), *shape], dtype=np.int64)
    return Compiled(sizes, packed.values, layer_values(packed.sizes).size + int(shape[0]))
