"""Phase-modulated neural network: the feedback model of one coupling dimension (eq. IV.27-IV.30).

    h_1 = tanh(W_1 z + b_1), ..., h_L = tanh(W_L h_{L-1} + b_L)        z = (ds - mean) / scale
    m = G(p, u) * (W_m h_L + b_m)                                      G_i = psi_i(p) u / sum_j psi_j(p)
    c = w_c . m = s + r . h_L                                          r = W_m^T (G w_c), s = b_m . (G w_c)

There is no output bias: where the phase velocity u is zero, c is zero, so the adapted movement still starts
smoothly and still ends at its goal, whatever the weights. The two linear last layers are folded with the
phase features, which depend on time only: a sample costs the hidden layers and one scalar product.
`stacked_pmnn` is what is trained.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from structlearn.feedback.coupling_model import Compiled, CouplingModel, Job, Trained
from structlearn.feedback.layered_kernel import layered, layered_numbers
from structlearn.feedback.training_parameters import TrainingParameters, UnrolledTrainingParameters
from structlearn.primitives import kernels

if TYPE_CHECKING:
    from structlearn.feedback.corrected_paths import CorrectedPaths

Layers = tuple[tuple[np.ndarray, np.ndarray], ...]


@dataclass(frozen=True)
class PhaseModulatedNetwork(CouplingModel):
    """A trained network; the standardisation of its input belongs to it.

    Attributes:
        input_mean: (D,) mean of the training deviations.
        input_scale: (D,) their std, positive.
        hidden: (weights (H, previous), biases (H,)) of each hidden layer, none for L = 0.
        phase_weights: (N, H) W_m, or (N, D) without a hidden layer.
        phase_biases: (N,) b_m.
        output_weights: (N,) w_c.
    """

    input_mean: np.ndarray
    input_scale: np.ndarray
    hidden: Layers
    phase_weights: np.ndarray
    phase_biases: np.ndarray
    output_weights: np.ndarray

    kernel = layered

    @classmethod
    def train(
        cls,
        jobs: Sequence[Job],
        parameters: TrainingParameters,
        hidden: Sequence[int] = (),
        initial: Self | None = None,
    ) -> list[Trained]:
        """All jobs as one stack, by RMSProp; see `CouplingModel.train`."""
        from structlearn.feedback.stacked_pmnn import train_networks

        return train_networks(jobs, parameters, hidden, initial)

    def train_in_unroll(
        self,
        training: "CorrectedPaths",
        validation: "CorrectedPaths",
        parameters: UnrolledTrainingParameters,
    ) -> Self:
        """See `unrolled_training`."""
        from structlearn.feedback.unrolled_training import train_unrolled

        return train_unrolled(training, validation, self, parameters)

    @property
    def sizes(self) -> list[int]:
        """Number of inputs, then the width of each hidden layer."""
        return [len(self.input_mean), *(len(biases) for _, biases in self.hidden)]

    @property
    def inputs(self) -> int:
        """D."""
        return len(self.input_mean)

    @property
    def kernel_count(self) -> int:
        """N."""
        return len(self.output_weights)

    def table(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rows (T, 1 + H) of s and r."""
        weights = kernels.features(p, u, self.kernel_count) * self.output_weights
        return np.column_stack([weights @ self.phase_biases, weights @ self.phase_weights])

    def compiled(self) -> Compiled:
        """See `layered_kernel`."""
        return layered_numbers(self.input_mean, self.input_scale, self.hidden)

    def arrays(self) -> dict[str, np.ndarray]:
        """Hidden layer l (from 0) is `hidden.<l>.weights` and `.biases`."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        for layer, (weights, biases) in enumerate(self.hidden):
            arrays |= {f"hidden.{layer}.weights": weights, f"hidden.{layer}.biases": biases}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The inverse of `arrays`."""
        hidden = [
            (arrays[f"hidden.{layer}.weights"], arrays[f"hidden.{layer}.biases"])
            for layer in range(sum(name.endswith(".weights") for name in arrays))
        ]
        return cls(hidden=tuple(hidden), **{name: arrays[name] for name in _ARRAYS})

    def fault(self) -> str:
        """Layers that do not fit together, too few kernels, a scale of 0, or what is not finite."""
        count, sizes = self.kernel_count, self.sizes
        if count < 2:
            return f"has {count} phase kernels, needs about {kernels.KERNEL_COUNT}"
        layers = [*self.hidden, (self.phase_weights, self.phase_biases)]
        shapes = [(weights.shape, biases.shape) for weights, biases in layers]
        fitting = [
            ((after, before), (after,)) for before, after in zip(sizes, [*sizes[1:], count], strict=True)
        ]
        if self.input_scale.shape != (sizes[0],) or shapes != fitting:
            return f"has layers that do not fit together: {shapes}"
        return super().fault() if (self.input_scale > 0).all() else "has an input scale of 0"

    def behind(self, mean: np.ndarray, scale: np.ndarray, layers: Layers) -> Self:
        """This network of a code as one of the deviations that are encoded.

        Args:
            mean: (D,) taken off the deviations.
            scale: (D,) by which they are divided then.
            layers: of the encoder, all tanh but the last, which is linear and gives the code.
        """
        *before, (weights, biases) = layers
        inner = [*self.hidden, (self.phase_weights, self.phase_biases)]
        first = inner[0][0] / self.input_scale
        inner[0] = (first @ weights, inner[0][1] + first @ (biases - self.input_mean))
        *hidden, (phase_weights, phase_biases) = inner
        return type(self)(mean, scale, (*before, *hidden), phase_weights, phase_biases, self.output_weights)


_ARRAYS = ("input_mean", "input_scale", "phase_weights", "phase_biases", "output_weights")


def open_loop(weights: np.ndarray) -> PhaseModulatedNetwork:
    """A policy that needs no sensor: c = G(p, u) . weights, as a network without inputs.

    Args:
        weights: (N,) one per phase feature.
    """
    weights = np.asarray(weights, dtype=float)
    nothing = np.zeros((len(weights), 0))
    return PhaseModulatedNetwork(nothing[0], nothing[0], (), nothing, weights, np.ones(len(weights)))
