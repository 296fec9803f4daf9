"""Adam, compiled; the rule is torch's."""

import math

import numba
import numpy as np
from pydantic import Field

from structlearn.ground.params import Parameters


class AdamParameters(Parameters):
    """The optimiser. Fields: `params.yaml`, `train_dynamics.learning.networks`."""

    rate: float = Field(gt=0)
    batch: int = Field(ge=1)
    second_moment_decay: float = Field(gt=0, lt=1)


MEAN_DECAY, SMALLEST_ROOT = 0.9, 1e-8
"""Per step, of the running mean of gradients; added to the root of their mean square. They are torch's."""


@numba.njit(cache=True, error_model="numpy")  # without a check of each divisor it becomes vectors
def adam_step(
    variable: np.ndarray,
    gradient: np.ndarray,
    moments: tuple[np.ndarray, np.ndarray],
    rate: float,
    decay: float,
    count: int,
) -> None:
    """One step in place.

    Args:
        variable: of any shape, contiguous.
        gradient: of its shape.
        moments: running means of gradients and of their squares, of its shape.
        rate: learning rate.
        decay: of the mean of squares, per step.
        count: of this step, from 1.
    """
    mean, square = moments[0].reshape(-1), moments[1].reshape(-1)
    values, slopes = variable.reshape(-1), gradient.reshape(-1)
    step, root = rate / (1.0 - MEAN_DECAY**count), math.sqrt(1.0 - decay**count)
    for place in range(len(values)):
        mean[place] += (1.0 - MEAN_DECAY) * (slopes[place] - mean[place])
        square[place] += (1.0 - decay) * (slopes[place] * slopes[place] - square[place])
        values[place] -= step * mean[place] / (math.sqrt(square[place]) / root + SMALLEST_ROOT)
