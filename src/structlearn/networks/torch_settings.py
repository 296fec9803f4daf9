"""What all trainings with torch share: precision, seeds and threads."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor


def as_tensor(values: np.ndarray) -> Tensor:
    """An array in single precision, which suffices for training networks."""
    return torch.tensor(values, dtype=torch.float32)


def seeded(seed: int) -> torch.Generator:
    """Source of initial weights, batches and dropout masks."""
    return torch.Generator().manual_seed(seed)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch use one thread in the body: small networks lose more to threads than they win."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
