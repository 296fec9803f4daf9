"""Intervals of numbers from one time series, whose neighbouring samples are no independent evidence.

The series is cut into blocks that are longer than what its errors remember, and blocks are drawn anew with
replacement (Kuensch 1989, with blocks side by side). What is asked for must be a function of sums over
samples: then a draw costs as much as there are blocks, however many samples they have.
"""

import numpy as np


def block_count(samples: int, length: int) -> int:
    """Blocks of at least `length` samples in a series; one where it is shorter than two."""
    return max(1, samples // length)


def blocks(values: np.ndarray, length: int) -> list[np.ndarray]:
    """A series (N, ...) in blocks of at least `length` samples; the last one takes what is left."""
    return np.split(values, length * np.arange(1, block_count(len(values), length)))


def block_sums(values: np.ndarray, length: int) -> np.ndarray:
    """Sums over the blocks: (N, ...) -> (B, ...)."""
    return np.array([block.sum(axis=0) for block in blocks(values, length)])


def drawn_counts(count: int, draws: int, seed: int) -> np.ndarray:
    """(draws, count) how often each block is taken when as many blocks are drawn with replacement."""
    generator = np.random.default_rng(seed)
    return generator.multinomial(count, np.full(count, 1.0 / count), size=draws).astype(float)


def percentiles(samples: np.ndarray, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
    """Ends (...) of the interval that holds that share of drawn values (draws, ...)."""
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(samples, [tail, 1.0 - tail], axis=0)
    return low, high
