"""Feed-forward network of the deviations: the phase-modulated network without modulation (IV.9.3.3).

Its coupling term does not vanish with the phase velocity: for the comparison in table IV.5, not for a robot.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from structlearn.feedback.coupling_model import (
    Compiled,
    CouplingModel,
    Jobs,
    Nodes,
    Trained,
    TrainingParameters,
)
from structlearn.feedback.models.pmnn import layered, layered_fault, layered_numbers
from structlearn.networks.compiled_layers import Layers

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class FeedForwardNetwork(CouplingModel):
    """A trained feed-forward network with tanh hidden layers."""

    # (D,) subtracted from the inputs, which are the deviations and, for `ffnn_phase`, p and u
    input_mean: np.ndarray
    input_scale: np.ndarray  # (D,) divides them
    layers: Layers  # weights and biases of each hidden layer, and of the output

    kernel = layered
    phases = 0

    @classmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> list[Trained]:
        """Train all jobs as one stack by RMSProp, always from scratch; see `CouplingModel.train`."""
        from structlearn.feedback.supervised_training import Stack, scaled_targets, standardised, train_stack
        from structlearn.networks.stacked_layers import Dropout, RowLayers
        from structlearn.networks.torch_settings import seeded

        units, inputs = standardised(jobs, cls.phases)
        scales, data = scaled_targets(jobs, inputs, None)
        generator = seeded(parameters.seed)
        stacked = RowLayers.initial(len(jobs), (inputs.shape[2], *hidden, 1), generator)
        dropout = Dropout(parameters.dropout, generator)

        def forward(inputs: "Tensor", modulation: None, training: bool) -> "Tensor":
            return stacked.forward(inputs, training, dropout).squeeze(-1)

        def network(index: int) -> FeedForwardNetwork:
            *before, (weights, biases) = stacked.layers_of(index)
            last = (weights * scales[index], biases * scales[index])
            return cls(*units[index], (*before, last))

        return train_stack(Stack(stacked.parameters(), forward), data, parameters, network)

    @property
    def inputs(self) -> int:
        """Number of deviations."""
        return len(self.input_mean) - self.phases

    def table(self, p: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The output layer, bias first, then the phase inputs."""
        weights, biases = self.layers[-1]
        readout = np.broadcast_to([*biases, *weights[0]], (len(p), 1 + weights.shape[1]))
        return np.column_stack([readout, *(p, u)[: self.phases]])

    def fault(self) -> str:
        """See `pmnn.layered_fault`."""
        return layered_fault(self.input_mean, self.input_scale, self.layers, 1) or super().fault()

    def compiled(self) -> Compiled:
        """See `pmnn.layered`."""
        return layered_numbers(self.input_mean, self.input_scale, self.layers[:-1], self.phases)
