"""Settings shared by all training with torch: precision, seeds, threads, optimisers."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch
from pydantic import Field
from torch import Tensor

from structlearn.core.compilation import numba
from structlearn.core.params import Parameters


class AdamParameters(Parameters):
    """Parameters of Adam. Fields: `params.yaml`, `train_dynamics.learning.networks`."""

    rate: float = Field(gt=0)
    batch: int = Field(ge=1)
    second_moment_decay: float = Field(gt=0, lt=1)


def as_tensor(values: np.ndarray) -> Tensor:
    """Tensor in single precision, which suffices for training networks."""
    return torch.tensor(values, dtype=torch.float32)


def seeded(seed: int) -> torch.Generator:
    """Generator for initial weights, batches and dropout masks."""
    return torch.Generator().manual_seed(seed)


@contextmanager
def one_thread() -> Iterator[None]:
    """Restrict torch to one thread: for small networks, threads cost more than they gain."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


MEAN_DECAY = 0.9  # of Adam's mean gradient, per step
SMALLEST_ROOT = 1e-8  # added to the RMS of a gradient, so that weights without a gradient do not move


class RootMeanSquarePropagation:
    """RMSProp: a step of the learning rate, divided by the running root mean square of each gradient.

    Same rule as torch's, applied to all weights as one vector: for many small tensors, torch's optimiser
    spends a fifth of a training step on calls. `parameters`: leaves, which become views of the vector;
    `rate`: step of a weight whose gradient is constant, may change between steps; `decay`: of the mean
    squared gradient, per step.
    """

    def __init__(self, parameters: Sequence[Tensor], rate: float, decay: float):
        self.parameters = list(parameters)
        self.weights = torch.cat([values.detach().flatten() for values in self.parameters])
        sizes = [values.numel() for values in self.parameters]
        for values, view in zip(self.parameters, self.weights.split(sizes), strict=True):
            values.data = view.view_as(values)
        self.mean_square = torch.zeros_like(self.weights)
        self.rate, self.decay = rate, decay

    @torch.no_grad()
    def step(self, loss: Tensor) -> None:
        """Take one step down the gradient of a loss."""
        gradients = torch.autograd.grad(loss, self.parameters)
        gradient = torch.cat([values.flatten() for values in gradients])
        self.mean_square.mul_(self.decay).addcmul_(gradient, gradient, value=1.0 - self.decay)
        self.weights.addcdiv_(gradient, self.mean_square.sqrt().add_(SMALLEST_ROOT), value=-self.rate)


@numba.njit(cache=True, error_model="numpy")  # no check for division by zero, so the loop vectorises
def adam_step(
    values: np.ndarray,
    gradient: np.ndarray,
    mean: np.ndarray,
    square: np.ndarray,
    rate: float,
    decay: float,
    count: int,
) -> None:
    """One step of Adam (Kingma and Ba 2015) in place, on vectors; `count`: number of the step, from 1."""
    step, root = rate / (1.0 - MEAN_DECAY**count), math.sqrt(1.0 - decay**count)
    for place in range(len(values)):
        mean[place] += (1.0 - MEAN_DECAY) * (gradient[place] - mean[place])
        square[place] += (1.0 - decay) * (gradient[place] * gradient[place] - square[place])
        values[place] -= step * mean[place] / (math.sqrt(square[place]) / root + SMALLEST_ROOT)


class Adam:
    """Adam for tensors that share a leading axis of models.

    Importing torch's own takes seconds, since it loads a compiler. `parameters`: contiguous leaves; `rate`
    may change between steps; `decay`: of the mean squared gradient per step.
    """

    def __init__(self, parameters: Sequence[Tensor], rate: float, decay: float = 0.999):
        self.parameters, self.rate, self.decay, self.count = list(parameters), rate, decay, 0
        self.moments = [np.zeros((2, *values.shape), as_array(values).dtype) for values in self.parameters]

    def step(self, gradients: Sequence[Tensor | None]) -> None:
        """One step; parameters with gradient None do not change."""
        self.count += 1
        for values, gradient, moments in zip(self.parameters, gradients, self.moments, strict=True):
            if gradient is not None:
                arrays = (as_array(values), as_array(gradient.contiguous()), *moments)
                value, slope, mean, square = (array.reshape(-1) for array in arrays)
                adam_step(value, slope, mean, square, self.rate, self.decay, self.count)

    def keep(self, models: np.ndarray) -> None:
        """Keep only some models; (M,) mask."""
        for values in self.parameters:
            values.data = values.data[torch.from_numpy(models)]
        self.moments = [np.compress(models, moments, axis=1) for moments in self.moments]  # contiguous


def as_array(values: Tensor) -> np.ndarray:
    """View of a tensor's memory."""
    return values.detach().numpy()
