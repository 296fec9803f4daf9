"""Settings shared by all training with torch: precision, seeds, threads, optimisers."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch
from pydantic import Field
from torch import Tensor

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


class Adam:
    """Adam with torch's rule, step by step the same numbers.

    Torch's own optimisers load its compiler, which takes a process a second. `parameters`: leaves.
    """

    def __init__(self, parameters: Sequence[Tensor], rate: float):
        self.parameters, self.rate, self.count = list(parameters), rate, 0
        self.means, self.squares = (
            [torch.zeros_like(values) for values in self.parameters] for _ in range(2)
        )

    @torch.no_grad()
    def step(self, loss: Tensor) -> None:
        """One step down the gradient of a loss."""
        gradients = torch.autograd.grad(loss, self.parameters)
        self.count += 1
        size, root = self.rate / (1 - 0.9**self.count), (1 - 0.999**self.count) ** 0.5
        every = zip(gradients, self.parameters, self.means, self.squares, strict=True)
        for gradient, values, mean, square in every:
            mean.lerp_(gradient, 1 - 0.9)
            square.mul_(0.999).addcmul_(gradient, gradient, value=1 - 0.999)
            values.addcdiv_(mean, (square.sqrt() / root).add_(SMALLEST_ROOT), value=-size)
