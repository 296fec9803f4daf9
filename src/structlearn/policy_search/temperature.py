"""Weights of samples by their costs: the softmax of the cost-to-go and its temperature (dissertation IV.7.2).

    P_k,t = exp(-S_k,t / lambda_t) / sum_k exp(-S_k,t / lambda_t)

The text leaves lambda open. Here it is fixed, or, as in relative-entropy policy search, the lowest one whose
weights stay within a Kullback-Leibler divergence from the uniform weights, which says how greedy an update
may be without knowing the scale of the costs.
"""

import numba
import numpy as np

TOLERANCE = 1e-10
"""Of the divergence, relative to its bound, which for rounding's sake is not much below 1e-6."""
MOST_TRIALS = 400
"""Every eighth halves the bracket, so this is enough whatever the costs; three to six are usual."""
ROUNDING = 1e-12  # Costs at one time step that differ by less, relative to their size, are equal


def normalised(costs: np.ndarray) -> np.ndarray:
    """Costs of every time step mapped from [lowest, highest over the samples] to [0, 1].

    `costs`: (K, T) finite costs of K samples. Returns (K, T) costs without unit; 0 at time steps where all
    samples cost the same.
    """
    lowest, highest = costs.min(axis=0), costs.max(axis=0)
    # halved: the difference of two finite numbers may be infinite
    half_range = highest / 2 - lowest / 2
    differ = half_range > ROUNDING * np.maximum(abs(lowest), abs(highest))
    return np.where(differ, (costs / 2 - lowest / 2) / np.where(differ, half_range, 1.0), 0.0)


def probabilities(costs: np.ndarray, temperatures: np.ndarray) -> np.ndarray:
    """Weights of the samples at every time step (algorithm IV.4, line 6).

    `costs`: (K, T), smallest cost of each time step 0. `temperatures`: (T,) positive, in the costs' unit.
    Returns (K, T) positive or 0, sum over the samples 1.
    """
    weights = np.exp(-costs / temperatures)
    return weights / weights.sum(axis=0)


def bounded_temperatures(costs: np.ndarray, kl_bound: float, floor: float) -> np.ndarray:
    """Lowest temperatures at which the weights keep within a divergence from the uniform ones.

    The root of KL(lambda) = bound is where the dual of relative-entropy policy search has its minimum:

        g(lambda) = lambda bound + lambda log(mean_k exp(-S_k / lambda)),    dg/dlambda = bound - KL(lambda)

    `costs`: (K, T) normalised costs, smallest of each time step 0, largest at most 1. `kl_bound`: largest
    divergence in nat; beyond log K it is never met. `floor`: smallest temperature, where the bound leaves
    room for less (too few samples, or ties). Returns (T,) temperatures; the divergence is the bound wherever
    the temperature is above the floor.
    """
    return _bounded_temperatures(np.ascontiguousarray(costs.T), kl_bound, floor)


@numba.njit(cache=True)
def _bounded_temperatures(costs: np.ndarray, kl_bound: float, floor: float) -> np.ndarray:
    """The same of costs (T, K), time step by time step: each begins with the answer of the one before.

    Newton's method, bracketed, over x = log(1 / lambda).
    """
    steps, samples = costs.shape
    temperatures = np.full(steps, floor)
    coldest = -np.log(floor)
    # KL is the integral of b var_b(S) over b = 1 / lambda, no variance on [0, 1] exceeds 1/4: KL <= b^2 / 8
    warmest = 0.5 * np.log(8.0 * kl_bound)
    x = warmest
    for t in range(steps):
        if _divergence(costs[t], coldest)[0] <= kl_bound:
            continue
        low, high = warmest, coldest
        for trial in range(MOST_TRIALS):
            divergence, slope = _divergence(costs[t], x)
            if abs(divergence - kl_bound) <= TOLERANCE * kl_bound:
                break
            if divergence > kl_bound:
                high = x
            else:
                low = x
            x = _newton(x, divergence, slope, kl_bound, np.log(samples))
            if trial % 8 == 7 or not low < x < high:
                x = 0.5 * (low + high)
        temperatures[t] = np.exp(-x)
    return temperatures


@numba.njit(cache=True)
def _divergence(costs: np.ndarray, x: float) -> tuple[float, float]:
    """KL divergence of the weights of costs (K,) from uniform ones, and its derivative over x."""
    inverse = np.exp(x)
    total = first = second = 0.0
    for cost in costs:
        scaled = inverse * cost
        weight = np.exp(-scaled)
        total += weight
        first += weight * scaled
        second += weight * scaled**2
    mean = first / total
    return np.log(len(costs) / total) - mean, second / total - mean**2


@numba.njit(cache=True)
def _newton(x: float, divergence: float, slope: float, kl_bound: float, most: float) -> float:
    """Newton's step for the logit of KL / log K, NaN where there is none.

    KL grows as exp(2 x) first and ends at log K, so that its logit is nearly a straight line.
    """
    missing = most - divergence
    if divergence <= 0.0 or missing <= 0.0 or slope <= 0.0:
        return np.nan
    excess = np.log(divergence / missing) - np.log(kl_bound / (most - kl_bound))
    return x - excess * divergence * missing / (slope * most)
