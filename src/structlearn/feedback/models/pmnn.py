"""Phase-modulated neural network: the feedback model of one coupling dimension (eq. IV.27-IV.30).

    h_1 = tanh(W_1 z + b_1), ..., h_L = tanh(W_L h_{L-1} + b_L)        z = (ds - mean) / scale
    m = G(p, u) * (W_m h_L + b_m)                                      G_i = psi_i(p) u / sum_j psi_j(p)
    c = w_c . m = s + r . h_L                                          r = W_m^T (G w_c), s = b_m . (G w_c)

There is no output bias: where the phase velocity u is zero, c is zero, so the adapted movement still starts
smoothly and ends at its goal, whatever the weights. The two linear last layers are folded with the phase
features, which depend on time only, so a sample costs the hidden layers and one scalar product. Training is
in `stacked_pmnn`.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Self

import numpy as np

from structlearn.core.compilation import numba
from structlearn.feedback.coupling_model import (
    Compiled,
    CouplingModel,
    Jobs,
    Nodes,
    Trained,
    TrainingParameters,
    UnrolledTrainingParameters,
    kernel,
)
from structlearn.networks.compiled_layers import Layers, hidden_layers, layer_values, pack
from structlearn.primitives import kernels

if TYPE_CHECKING:
    from structlearn.feedback.corrected_paths import CorrectedPaths


@kernel
def layered(sizes, values, row, deviations, memory):
    """Coupling term at one sample: h = tanh layers of [ds, row[1 + H :]], c = row[0] + row[1 : 1 + H] . h."""
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


def layered_numbers(mean: np.ndarray, scale: np.ndarray, hidden: Layers, extra: int = 0) -> Compiled:
    """Arguments of `layered`, also for `ffnn`; `mean`, `scale`: (D + X,) standardise the inputs."""
    packed = pack([(mean, scale, hidden)])
    shape = packed.sizes[0]
    sizes = np.array([len(packed.values), extra, len(hidden), *shape], dtype=np.int64)
    return Compiled(sizes, packed.values, layer_values(packed.sizes).size + int(shape[0]))


def layered_fault(mean: np.ndarray, scale: np.ndarray, layers: Layers, outputs: int) -> str:
    """Why layers and standardisation do not fit together, or a scale is invalid; empty if all is well."""
    shapes = [(weights.shape, biases.shape) for weights, biases in layers]
    widths = [len(mean), *(len(biases) for _, biases in layers[:-1]), outputs]
    if scale.shape != mean.shape or shapes != [
        ((after, before), (after,)) for before, after in pairwise(widths)
    ]:
        return f"has layers that do not fit together: {shapes}"
    return "" if (scale > 0).all() else "has an input scale that is not positive"


@dataclass(frozen=True)
class PhaseModulatedNetwork(CouplingModel):
    """A trained network, including the standardisation of its inputs."""

    input_mean: np.ndarray  # (D,) mean of the training deviations
    input_scale: np.ndarray  # (D,) std, positive
    hidden: Layers  # (weights (H, previous), biases (H,)) of each hidden layer, none for L = 0
    phase_weights: np.ndarray  # (N, H) W_m, or (N, D) without a hidden layer
    phase_biases: np.ndarray  # (N,) b_m
    output_weights: np.ndarray  # (N,) w_c

    kernel = layered

    @classmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> "list[Trained[PhaseModulatedNetwork]]":
        """Train all jobs as one stack by RMSProp; see `CouplingModel.train`."""
        from structlearn.feedback.stacked_pmnn import train_networks

        return train_networks(jobs, parameters, hidden, initial)

    def train_in_unroll(
        self, training: "CorrectedPaths", validation: "CorrectedPaths", parameters: UnrolledTrainingParameters
    ) -> "PhaseModulatedNetwork":
        """See `stacked_pmnn.train_unrolled`."""
        from structlearn.feedback.stacked_pmnn import train_unrolled

        return train_unrolled(training, validation, self, parameters)

    @property
    def sizes(self) -> list[int]:
        """Number of inputs, then the width of each hidden layer."""
        return [len(self.input_mean), *(len(biases) for _, biases in self.hidden)]

    @property
    def inputs(self) -> int:
        """Number of channels D."""
        return len(self.input_mean)

    @property
    def kernel_count(self) -> int:
        """Number of kernels N."""
        return len(self.output_weights)

    def table(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rows (T, 1 + H): s, then r."""
        weights = kernels.features(p, u, self.kernel_count) * self.output_weights
        return np.column_stack([weights @ self.phase_biases, weights @ self.phase_weights])

    def compiled(self) -> Compiled:
        """See `layered`."""
        return layered_numbers(self.input_mean, self.input_scale, self.hidden)

    def fault(self) -> str:
        """Layers that do not fit together, too few kernels, a scale of 0, or a value that is not finite."""
        if self.kernel_count < 2:
            return f"has {self.kernel_count} phase kernels, needs about {kernels.KERNEL_COUNT}"
        layers = (*self.hidden, (self.phase_weights, self.phase_biases))
        fault = layered_fault(self.input_mean, self.input_scale, layers, self.kernel_count)
        return fault or super().fault()

    def behind(self, mean: np.ndarray, scale: np.ndarray, layers: Layers) -> Self:
        """Compose this network of a code with the encoder, into a network of the deviations (D,).

        `mean`, `scale`: (D,) standardise the deviations. `layers`: of the encoder, all tanh except the last,
        which is linear and outputs the code.
        """
        *before, (weights, biases) = layers
        inner = [*self.hidden, (self.phase_weights, self.phase_biases)]
        first = inner[0][0] / self.input_scale
        inner[0] = (first @ weights, inner[0][1] + first @ (biases - self.input_mean))
        *hidden, (phase_weights, phase_biases) = inner
        return type(self)(mean, scale, (*before, *hidden), phase_weights, phase_biases, self.output_weights)


def open_loop(weights: np.ndarray) -> PhaseModulatedNetwork:
    """Policy without sensors, c = G(p, u) . weights (N,), as a network without inputs."""
    weights = np.asarray(weights, dtype=float)
    nothing = np.zeros((len(weights), 0))
    return PhaseModulatedNetwork(nothing[0], nothing[0], (), nothing, weights, np.ones(len(weights)))
