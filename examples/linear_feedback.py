"""A feedback network of one's own: c = tanh(u) (w . ds + b) by least squares, which fades with the phase.

Put it into `src/structlearn/feedback/models/`, or its folder into STRUCTLEARN_NETWORKS, and write `network:
linear_feedback` below `feedback:` in a task: it is trained and put into the skill.
"""

from dataclasses import dataclass

import numpy as np

from structlearn.feedback import Compiled, CouplingModel, Trained, kernel


@kernel
def weighted(sizes, values, row, deviations, memory):
    """Coupling term of one sample: row is [tanh u], values are the weights of the deviations and the bias."""
    channels = sizes[0]
    c = values[channels]
    for i in range(channels):
        c += values[i] * deviations[i]
    return row[0] * c


@dataclass(frozen=True)
class LinearFeedback(CouplingModel):
    """Weights (D,) of the deviations, and the bias."""

    weights: np.ndarray
    bias: np.ndarray

    kernel = weighted

    @property
    def inputs(self):
        """Number of channels."""
        return len(self.weights)

    def validation_error(self):
        """What is wrong with the model; compiled code does not look at bounds."""
        if self.weights.ndim != 1 or self.bias.ndim != 0:
            return "has other shapes"
        return super().validation_error()

    def time_features(self, p, u):
        """How far the coupling has faded at each phase."""
        return np.tanh(u)[:, None]

    def compiled(self):
        """Numbers for the kernel."""
        return Compiled(np.array([self.inputs]), np.append(self.weights, self.bias), memory=0)


def train(jobs, parameters, hidden=(), initial=None):
    """Least squares on the training rows: nothing to stop, nothing to start from."""
    trained = []
    for data, fold in jobs:
        inputs = np.column_stack([data.deviation, np.ones(len(data.target))])[fold.train]
        inputs *= np.tanh(data.phase_velocity[fold.train, None])
        *weights, bias = np.linalg.lstsq(inputs, data.target[fold.train], rcond=1e-6)[0]
        trained.append(Trained.closed_form(LinearFeedback(np.array(weights), np.array(bias))))
    return trained
