"""A feedback network of one's own: c = tanh(u) (w . ds + b) by least squares, which fades with the phase.

Put it into `src/structlearn/feedback/models/`, or its folder into STRUCTLEARN_NETWORKS, and write `network:
linear_feedback` into `params.yaml`: the stages train it, run it on the board and put it into the skill.
"""

from dataclasses import dataclass

import numba
import numpy as np

from structlearn.feedback import Compiled, CouplingModel, Trained, kernel


@kernel
def weighted(sizes, values, row, deviations, memory):
    """Coupling term of one sample: row is [tanh u], values are the weights of the deviations and the bias."""
    channels = sizes[0]
    weights, c = numba.carray(values, channels + 1), values[channels]
    for i in range(channels):
        c += weights[i] * deviations[i]
    return row[0] * c


@dataclass(frozen=True)
class LinearFeedback(CouplingModel):
    """Weights (D,) of the deviations, and the bias."""

    weights: np.ndarray
    bias: np.ndarray

    kernel = weighted

    @classmethod
    def train(cls, jobs, parameters, hidden=(), initial=None):
        """Least squares on the training rows: nothing to stop, nothing to start from."""
        found = []
        for data, fold in jobs:
            inputs = np.column_stack([data.deviation, np.ones(len(data.target))])[fold.train]
            inputs *= np.tanh(data.phase_velocity[fold.train, None])
            *weights, bias = np.linalg.lstsq(inputs, data.target[fold.train], rcond=1e-6)[0]
            found.append(Trained.at_once(cls(np.array(weights), np.array(bias))))
        return found

    @property
    def inputs(self):
        """Number of channels."""
        return len(self.weights)

    def fault(self):
        """What is wrong with the model; compiled code does not look at bounds."""
        return super().fault() if self.weights.ndim == 1 and self.bias.ndim == 0 else "has other shapes"

    def table(self, p, u):
        """How far the coupling has faded at each phase."""
        return np.tanh(u)[:, None]

    def compiled(self):
        """Numbers for the kernel."""
        return Compiled(np.array([self.inputs]), np.append(self.weights, self.bias), memory=0)
