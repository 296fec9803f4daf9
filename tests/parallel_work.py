"""Work for processes that start quickly: little is imported here."""

import os
import time
from pathlib import Path

import numpy as np

from structlearn.core.parallel import parallel_map


def noisy_mean(seed):
    return np.random.default_rng(seed).normal(size=1000).mean()


def noisy_matrix(seed):
    """Large enough for BLAS to take several threads, and with them another order of sums."""
    rng = np.random.default_rng(seed)
    return np.linalg.solve(rng.normal(size=(300, 300)), rng.normal(size=(300, 300))).tobytes()


def square(item, deadly=()):
    """A number's square, or the end of the process."""
    if item in deadly:
        os._exit(1)
    return item**2


def first_number(item):
    """Of an array; of zeros, the end of the process."""
    if not item[0]:
        os._exit(1)
    return item[0]


def square_at_the_second_try(item, marker):
    if item == 3 and not marker.exists():
        marker.touch()
        os._exit(1)
    return item**2


def slow_first_square(item):
    time.sleep(0.1 if item == 0 else 0.0)
    return item**2


def product_of_ones(size):
    """Large enough for torch to take all its threads."""
    import torch

    return float((torch.ones(400 + size, 400) @ torch.ones(400, 400)).sum())


def missing(item):
    return "lost", item


def process_of(item):
    return os.getpid()


def processes_within(item):
    return os.getpid(), parallel_map(process_of, range(3), "within")


class Deadly:
    """Ends the process that it is sent to."""

    def __getstate__(self):
        return True

    def __setstate__(self, state):
        os._exit(1)


def endless(path):
    """Work that has begun when the file exists, and that does not end by itself."""
    Path(path).touch()
    time.sleep(600.0)
