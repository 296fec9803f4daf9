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


def square_root(values: Tensor) -> Tensor:
    """Square root of positive values, for gradients; not of 0, where it is NaN.

    Digits of torch's sqrt depend on the processor, by estimates in MKL (`benchmarks/processor_bits.py`).
    """
    return values * values.rsqrt()


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
        root = torch.from_numpy(np.sqrt(self.mean_square.numpy()))  # as `square_root`, also of 0
        self.weights.addcdiv_(gradient, root.add_(SMALLEST_ROOT), value=-self.rate)


class Adam:
    """Adam (Kingma and Ba 2015) for tensors that share a leading axis of models, by torch's fused kernel.

    Same steps as `torch.optim.Adam`, without its bookkeeping (7 to 20 % of a step for small networks) and
    without importing it, which loads a compiler for seconds. `rate` may change between steps; `decay`: of the
    mean squared gradient per step.
    """

    def __init__(self, parameters: Sequence[Tensor], rate: float, decay: float = 0.999):
        self.parameters, self.rate, self.decay = list(parameters), rate, decay
        self.means, self.squares = ([torch.zeros_like(part) for part in self.parameters] for _ in range(2))
        self.count = torch.zeros(())  # steps taken

    @torch.no_grad()
    def step(self, gradients: Sequence[Tensor | None]) -> None:
        """One step; parameters with gradient None do not change."""
        every = zip(gradients, self.parameters, self.means, self.squares, strict=True)
        # the kernel walks memory in order, regardless of strides
        moved = [(slope.contiguous(), *tensors) for slope, *tensors in every if slope is not None]
        slopes, values, means, squares = (list(tensors) for tensors in zip(*moved, strict=True))
        self.count += 1
        torch._fused_adam_(
            values,
            slopes,
            means,
            squares,
            [],
            [self.count] * len(moved),
            lr=self.rate,
            beta1=MEAN_DECAY,
            beta2=self.decay,
            weight_decay=0.0,
            eps=SMALLEST_ROOT,
            amsgrad=False,
            maximize=False,
        )

    def keep(self, models: Tensor) -> None:
        """Keep only some models; (M,) mask."""
        for values in self.parameters:
            values.data = values.data[models]
        self.means, self.squares = ([part[models] for part in kept] for kept in (self.means, self.squares))
