"""Ordinary network of the deviations: the phase-modulated one with its modulation taken away (IV.9.3.3).

Its coupling term does not vanish with the phase velocity: a rival in table IV.5, not for a robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from structlearn.feedback.coupling_model import Compiled, CouplingModel, Job, Trained
from structlearn.feedback.layered_kernel import layered, layered_numbers
from structlearn.feedback.training_parameters import TrainingParameters

if TYPE_CHECKING:
    from torch import Generator, Tensor


@dataclass(frozen=True)
class FeedForwardNetwork(CouplingModel):
    """A trained network with tanh in every hidden layer.

    Attributes:
        input_mean: (D,) taken off the inputs, which are the deviations and, in `ffnn_phase`, p and u.
        input_scale: (D,) by which they are divided then.
        layers: weights and biases of each hidden layer, and of the output.
    """

    input_mean: np.ndarray
    input_scale: np.ndarray
    layers: Sequence[tuple[np.ndarray, np.ndarray]]

    kernel = layered
    phases = 0

    @classmethod
    def train(
        cls,
        jobs: Sequence[Job],
        parameters: TrainingParameters,
        hidden: Sequence[int] = (),
        initial: Self | None = None,
    ) -> list[Trained]:
        """All jobs as one stack, by RMSProp, from the start; see `CouplingModel.train`."""
        from structlearn.feedback.supervised_training import scaled_targets, standardised, train_stack
        from structlearn.networks.torch_settings import seeded

        units, inputs = standardised(jobs, cls.phases)
        scales, data = scaled_targets(jobs, inputs, None)
        generator = seeded(parameters.seed)
        stack = StackedFeedForwardNetworks(len(jobs), inputs.shape[2], hidden, parameters.dropout, generator)

        def network(index: int) -> Self:
            *before, (weights, biases) = stack.layers.layers_of(index)
            last = (weights * scales[index], biases * scales[index])
            return cls(*units[index], (*before, last))

        return train_stack(stack, data, parameters, network)

    @property
    def inputs(self) -> int:
        """Number of deviations."""
        return len(self.input_mean) - self.phases

    def table(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The output layer, bias first, and what the network sees of the phase."""
        weights, biases = self.layers[-1]
        readout = np.broadcast_to([*biases, *weights[0]], (len(p), 1 + weights.shape[1]))
        return np.column_stack([readout, *(p, u)[: self.phases]])

    def compiled(self) -> Compiled:
        """See `layered_kernel`."""
        return layered_numbers(self.input_mean, self.input_scale, self.layers[:-1], self.phases)

    def arrays(self) -> dict[str, np.ndarray]:
        """Layer l (from 0) is `layers.<l>.weights` and `.biases`."""
        arrays = {"input_mean": self.input_mean, "input_scale": self.input_scale}
        for place, (weights, biases) in enumerate(self.layers):
            arrays |= {f"layers.{place}.weights": weights, f"layers.{place}.biases": biases}
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """The inverse of `arrays`."""
        places = range((len(arrays) - 2) // 2)
        layers = [(arrays[f"layers.{at}.weights"], arrays[f"layers.{at}.biases"]) for at in places]
        return cls(arrays["input_mean"], arrays["input_scale"], layers)


class StackedFeedForwardNetworks:
    """M networks as they are trained, with tanh and dropout in every hidden layer.

    Args:
        models: number of networks M.
        inputs: number of inputs D.
        hidden: nodes of each hidden layer.
        dropout: probability with which a hidden node is left out of a training step.
        generator: source of the initial weights and of the dropout masks.
    """

    def __init__(
        self, models: int, inputs: int, hidden: Sequence[int], dropout: float, generator: "Generator"
    ):
        from structlearn.networks.stacked_layers import Dropout, RowLayers

        self.layers = RowLayers.initial(models, (inputs, *hidden, 1), generator)
        self.dropout = Dropout(dropout, generator)

    def parameters(self) -> "list[Tensor]":
        """What is trained."""
        return self.layers.parameters()

    def forward(self, inputs: "Tensor", modulation: None = None, training: bool = False) -> "Tensor":
        """Coupling terms (M, B) of standardised inputs (M, B, D); there is no modulation to use."""
        return self.layers.forward(inputs, training, self.dropout).squeeze(-1)
