"""Error measures shared by several testbeds, and their confidence intervals.

Neighbouring samples of a time series are not independent. For intervals, a series is cut into blocks longer
than the correlation time of its errors, and blocks are resampled with replacement (non-overlapping block
bootstrap, Kuensch 1989). For statistics that depend on sums only, the cost of a draw is proportional to the
number of blocks.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import bdtr, stdtrit

if TYPE_CHECKING:
    import pandas as pd


def nmse(prediction: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Normalised mean squared error: mean squared error / variance of the target (ddof 0), per column.

    (T, ...), (T, ...) -> (...); predicting the target's mean gives 1. For a constant target it is infinite,
    or 0 if matched exactly.
    """
    error = np.mean((prediction - target) ** 2, axis=0)
    variance = np.var(target, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0.0, 0.0, error / variance)


def pairwise_spread(curves: np.ndarray) -> float:
    """Mean Euclidean distance over pairs of aligned curves and over time: (L, T, D) -> the curves' unit."""
    first, second = np.triu_indices(len(curves), k=1)
    return float(np.linalg.norm(curves[first] - curves[second], axis=-1).mean())


def mean_interval(samples: np.ndarray, confidence: float = 0.95) -> tuple[float, float]:
    """Mean of independent samples (N,), and half the width of its confidence interval (t distribution).

    For a paired comparison, pass the differences of pairs. A single sample has half width NaN.
    """
    count = len(samples)
    if count < 2:
        return float(np.mean(samples)), float("nan")
    quantile = stdtrit(count - 1, 0.5 + 0.5 * confidence)
    return float(np.mean(samples)), float(quantile * np.std(samples, ddof=1) / np.sqrt(count))


def median_interval(samples: np.ndarray, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of the median between two order statistics of independent samples (N,), for any distribution.

    Between the k-th lowest and the k-th highest lies the median unless fewer than k samples are on one side
    of it (binomial). NaN if there are too few samples: 95 % need 6.
    """
    count = len(samples)
    k = np.searchsorted(bdtr(np.arange(count), count, 0.5), 0.5 - 0.5 * confidence, side="right")
    if k == 0:
        return float("nan"), float("nan")
    ordered = np.sort(samples)
    return float(ordered[k - 1]), float(ordered[-k])


BETTER, WORSE, UNDECIDED = "better", "worse", "undecided"


def verdict(low: np.ndarray | float, high: np.ndarray | float) -> np.ndarray:
    """`BETTER`, `WORSE` or `UNDECIDED` (...) for gains with intervals from `low` to `high` (...)."""
    return np.select([np.greater(low, 0), np.less(high, 0)], [BETTER, WORSE], UNDECIDED)


def block_count(samples: int, length: int) -> int:
    """Number of blocks of at least `length` samples in a series, at least one."""
    return max(1, samples // length)


def blocks(values: np.ndarray, length: int) -> list[np.ndarray]:
    """Split a series (N, ...) into blocks of at least `length` samples; the last one takes the remainder."""
    return np.split(values, length * np.arange(1, block_count(len(values), length)))


def block_sums(values: np.ndarray, length: int) -> np.ndarray:
    """Sums over blocks: (N, ...) -> (B, ...)."""
    return np.array([block.sum(axis=0) for block in blocks(values, length)])


def drawn_counts(count: int, draws: int, seed: int) -> np.ndarray:
    """Bootstrap counts (draws, count): how often each of `count` blocks is drawn, with replacement."""
    generator = np.random.default_rng(seed)
    return generator.multinomial(count, np.full(count, 1.0 / count), size=draws).astype(float)


def percentiles(samples: np.ndarray, confidence: float = 0.95) -> tuple[Any, Any]:
    """Ends (...) of the central interval that contains a share `confidence` of drawn values (draws, ...)."""
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(samples, [tail, 1.0 - tail], axis=0)
    return low, high


def matching(table: "pd.DataFrame", **values: object) -> "pd.DataFrame":
    """Rows of a table with the given values in the given columns."""
    return table[np.logical_and.reduce([table[name] == value for name, value in values.items()])]
