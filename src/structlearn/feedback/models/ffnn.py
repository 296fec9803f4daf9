"""Feed-forward network of the deviations: the phase-modulated network without modulation (IV.9.3.3).

Its coupling term does not vanish with the phase velocity: for the comparison in table IV.5, not for a robot.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from structlearn.core.compilation import kernel
from structlearn.feedback.coupling_model import Compiled, CouplingModel
from structlearn.feedback.models.pmnn import mlp_error, pack_mlp
from structlearn.networks.compiled_layers import Layers, last_hidden


@kernel
def ffnn_kernel(sizes, values, row, deviations, memory):
    """Coupling term at one sample; `row`: the output layer, bias first, then the phase inputs."""
    layers, count = sizes[0], sizes[1]
    width = sizes[layers + 1]
    phases = sizes[layers + 2]
    inputs = memory[len(memory) - count :]
    for i in range(count - phases):
        inputs[i] = deviations[i]
    for i in range(phases):
        inputs[count - phases + i] = row[1 + width + i]
    h = last_hidden(sizes, values, inputs, memory)
    c = row[0]
    for j in range(width):
        c += row[1 + j] * h[j]
    return c


@dataclass(frozen=True)
class FeedForwardNetwork(CouplingModel):
    """A trained feed-forward network with tanh hidden layers."""

    # (D,) subtracted from the inputs, which are the deviations and, for `ffnn_phase`, p and u
    input_mean: np.ndarray
    input_scale: np.ndarray  # (D,) divides them
    layers: Layers  # weights and biases of each hidden layer, and of the output

    kernel = ffnn_kernel
    phases: ClassVar[int] = 0

    @property
    def inputs(self) -> int:
        """Number of deviations."""
        return len(self.input_mean) - self.phases

    def time_features(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The output layer, bias first, then the phase inputs."""
        weights, biases = self.layers[-1]
        readout = np.broadcast_to([*biases, *weights[0]], (len(p), 1 + weights.shape[1]))
        return np.column_stack([readout, *(p, u)[: self.phases]])

    def validation_error(self) -> str:
        """See `pmnn.mlp_error`."""
        return mlp_error(self.input_mean, self.input_scale, self.layers, 1) or super().validation_error()

    def compiled(self) -> Compiled:
        """Arguments of `last_hidden`, the number of phase inputs, and room for the inputs."""
        sizes, values, memory = pack_mlp(self.input_mean, self.input_scale, self.layers[:-1])
        return Compiled(np.append(sizes, self.phases), values, memory + len(self.input_mean))
