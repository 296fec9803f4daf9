"""Phase-modulated neural network: the feedback model of one coupling dimension (eq. IV.27-IV.30).

There is no output bias: where the phase velocity u is zero, c is zero, so the adapted movement still starts
smoothly and ends at its goal, whatever the weights.

`coupling_term` is the network as in the text. `pmnn_kernel` is what a tick calls: the two linear last layers
are folded with the phase features, which depend on time only, so that a sample costs the hidden layers and
one scalar product, c = s + r . h_L. Training is in `training.pmnn`.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from structlearn.core.compilation import kernel
from structlearn.feedback.coupling_model import Compiled, CouplingModel
from structlearn.networks.compiled_layers import Layers, last_hidden, layer_values, pack
from structlearn.primitives import kernels


def coupling_term(network: "PhaseModulatedNetwork", deviations: np.ndarray, p: float, u: float) -> float:
    """Coupling term at one sample (eq. IV.27-IV.30); the reference of `pmnn_kernel`. `deviations`: (D,)."""
    h = (deviations - network.input_mean) / network.input_scale
    for weights, biases in network.hidden:
        h = np.tanh(weights @ h + biases)
    modulation = kernels.features(p, u, network.kernel_count)  # (N,) G_i = psi_i(p) u / sum_j psi_j(p)
    m = modulation * (network.phase_weights @ h + network.phase_biases)
    return float(network.output_weights @ m)


@kernel
def pmnn_kernel(sizes, values, row, deviations, memory):
    """Coupling term at one sample, c = s + r . h_L; `row`: s and r, of `time_features`."""
    h = last_hidden(sizes, values, deviations, memory)
    c = row[0]
    for j in range(len(h)):
        c += row[1 + j] * h[j]
    return c


@dataclass(frozen=True)
class PhaseModulatedNetwork(CouplingModel):
    """A trained network, including the standardisation of its inputs."""

    input_mean: np.ndarray  # (D,) mean of the training deviations
    input_scale: np.ndarray  # (D,) std, positive
    hidden: Layers  # (weights (H, previous), biases (H,)) of each hidden layer, none for L = 0
    phase_weights: np.ndarray  # (N, H) W_m, or (N, D) without a hidden layer
    phase_biases: np.ndarray  # (N,) b_m
    output_weights: np.ndarray  # (N,) w_c

    kernel = pmnn_kernel

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

    def time_features(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rows (T, 1 + H): s = b_m . (G w_c), then r = W_m^T (G w_c)."""
        weights = kernels.features(p, u, self.kernel_count) * self.output_weights
        return np.column_stack([weights @ self.phase_biases, weights @ self.phase_weights])

    def compiled(self) -> Compiled:
        """See `pack_mlp`."""
        return pack_mlp(self.input_mean, self.input_scale, self.hidden)

    def validation_error(self) -> str:
        """Layers that do not fit together, too few kernels, a scale of 0, or a value that is not finite."""
        if self.kernel_count < 2:
            return f"has {self.kernel_count} phase kernels, needs about {kernels.KERNEL_COUNT}"
        layers = (*self.hidden, (self.phase_weights, self.phase_biases))
        error = mlp_error(self.input_mean, self.input_scale, layers, self.kernel_count)
        return error or super().validation_error()

    def compose_encoder(self, mean: np.ndarray, scale: np.ndarray, layers: Layers) -> Self:
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


def pack_mlp(mean: np.ndarray, scale: np.ndarray, hidden: Layers) -> Compiled:
    """Arguments of `last_hidden`; `mean`, `scale`: (D,) standardise the inputs."""
    packed = pack([(mean, scale, hidden)])
    sizes = np.array([len(hidden), *packed.sizes[0]], dtype=np.int64)
    return Compiled(sizes, packed.values, layer_values(packed.sizes).size)


def mlp_error(mean: np.ndarray, scale: np.ndarray, layers: Layers, outputs: int) -> str:
    """Why layers and standardisation do not fit together, or a scale is invalid; empty if all is well."""
    shapes = [(weights.shape, biases.shape) for weights, biases in layers]
    widths = [len(mean), *(len(biases) for _, biases in layers[:-1]), outputs]
    if scale.shape != mean.shape or shapes != [
        ((after, before), (after,)) for before, after in pairwise(widths)
    ]:
        return f"has layers that do not fit together: {shapes}"
    return "" if (scale > 0).all() else "has an input scale that is not positive"
