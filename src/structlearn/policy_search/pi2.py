"""Path integral policy improvement with covariance adaptation, PI2-CMA (dissertation IV.7.2, algorithm IV.4).

Works for any episodic policy: draw parameters, roll each out, and pass the costs of every time step.

    policies = sample(distribution, parameters.samples, rng)        # (K, D)
    costs = ...                                                     # (K, T), a row per rollout
    distribution = update(distribution, policies, costs, parameters, activation)

At every time step, samples are weighted by their cost-to-go. As published, these weights are averaged over
time, early steps counting most, and the average updates all parameters of a policy. But the weight of a phase
kernel acts only while its kernel is active: earlier costs say nothing about it, and much later ones little,
since a movement primitive forgets. As in PI2's original form (Theodorou, Buchli and Schaal, 2010), the
average can be taken per parameter over the time steps at which it acts, and the cost-to-go can end at a
horizon. This is the benefit of observing the cost of every time step.

A rollout without a finite cost-to-go (it diverged, returned NaN, or its process died) has weight 0 at all
time steps, as if its cost were infinite; assigning it the worst cost of the others would attract the mean
where the others are all alike. A diverged rollout must return NaN or infinity, not a huge number, since costs
are normalised by their range and all others would become equal.

The weights are a softmax of the costs-to-go at each time step, P_k,t ~ exp(-S_k,t / lambda_t), normalised
over k. The text leaves lambda open. Here it is fixed or, as in relative-entropy policy search, the lowest one
whose weights stay within a Kullback-Leibler divergence from uniform weights, which bounds the greediness of
an update independently of the scale of the costs.

    Sigma_ml = sum_t w_t sum_k P_k,t (theta_k - theta)(theta_k - theta)^T

Around the old mean theta, the estimated covariance does not shrink on its own (weights independent of the
samples reproduce the old one on average) and grows along directions in which all good samples lie, as in
CMA-ES. A few rollouts cannot estimate the 325 unknowns of a covariance of 25 weights, as `full` (published)
tries; they can estimate 25 variances (`per_weight`), or their common scale (`rescaled`).
"""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import Field
from scipy.linalg import solve_triangular

from structlearn.core.compilation import numba
from structlearn.core.params import Parameters

RIDGE = 1e-12
"""Share of the mean variance added to a full estimate, to keep it positive definite in floating point when
one direction has become much narrower than another."""

TOLERANCE = 1e-10  # of the divergence, relative to its bound, which is at least 1e-6 because of rounding
MOST_TRIALS = 400  # every eighth halves the bracket, so this always suffices; three to six are typical
ROUNDING = 1e-12  # relative difference below which costs at one time step are equal


class CovarianceParameters(Parameters):
    """Adaptation of the covariance to the good samples."""

    # `per_weight`: the old covariance, with each parameter's standard deviation scaled by the root of
    # (sum_k w_k,d (theta_k,d - theta_d)^2 / Sigma_dd)^(1 / damping); `rescaled`: the old covariance times
    # (tr(Sigma_old^-1 Sigma_ml) / D)^(1 / damping); `full`: Sigma_ml, as in the text; `kept`: the old
    # covariance
    mode: Literal["per_weight", "rescaled", "full", "kept"]
    damping: float = Field(ge=1)  # for `per_weight` and `rescaled`; 1: no damping
    # for all but `kept`: smallest ratio of new to old variance of a parameter or in any direction. Without
    # it, `full` abandons every direction that the samples happen to miss; near 1 the covariance drifts
    # upwards, because chance can then only widen it.
    eigenvalue_floor: float = Field(gt=0, le=1)


def covariance_factor(covariance: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor of a covariance (D, D). Raises ValueError: it is not positive definite."""
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise ValueError("the covariance of the search distribution is not positive definite") from error


def adapted_covariance(
    old: np.ndarray, deviations: np.ndarray, weights: np.ndarray, parameters: CovarianceParameters
) -> np.ndarray:
    """New covariance (D, D), symmetric and positive definite.

    `rescaled` and `full` work in coordinates that whiten the old covariance, so they are invariant to linear
    changes of the policy's parameters; they use a sample's mean weight for all parameters. `old`: (D, D)
    covariance of the samples. `deviations`: (K, D) samples minus the old mean. `weights`: (K, D), summing to
    1 over the samples. Raises ValueError: the old covariance is not positive definite.
    """
    if parameters.mode == "kept":
        return old
    root, floor = covariance_factor(old), parameters.eigenvalue_floor
    if parameters.mode == "per_weight":
        ratios = np.sum(weights * deviations**2, axis=0) / np.diag(old)
        scale = np.sqrt(np.maximum(ratios ** (1.0 / parameters.damping), floor))
        return scale[:, None] * old * scale
    shared = weights.mean(axis=1)  # (K,), exact where the published average makes them equal
    white = solve_triangular(root, deviations.T, lower=True, check_finite=False)  # (D, K)
    if parameters.mode == "rescaled":
        ratio = np.sum(white * white * shared) / len(old)
        return max(ratio ** (1.0 / parameters.damping), floor) * old
    ratios, directions = np.linalg.eigh((white * shared) @ white.T)
    spread = (root @ directions) * np.sqrt(np.maximum(ratios, floor))
    full = spread @ spread.T
    full[np.diag_indices_from(full)] += RIDGE * np.trace(full) / len(full)
    return full


FEWEST_ROLLOUTS = 2  # a single rollout does not tell what is better


class PI2Parameters(Parameters):
    """Sampling and update of the search distribution. Fields: `params.yaml`, `refine.search`."""

    samples: int = Field(ge=FEWEST_ROLLOUTS)
    averaging: Literal["per_weight", "per_policy"]
    horizon: float = Field(gt=0, le=1)
    kl_bound: float = Field(ge=1e-6)
    temperature: float | None = Field(ge=1e-9)
    temperature_floor: float = Field(ge=1e-9)
    covariance: CovarianceParameters


@dataclass(frozen=True)
class SearchDistribution:
    """Gaussian search distribution over policy parameters."""

    mean: np.ndarray  # (D,) policy parameters, in their own unit
    covariance: np.ndarray  # (D, D) symmetric and positive definite

    def __post_init__(self) -> None:
        if self.mean.ndim != 1 or self.covariance.shape != 2 * self.mean.shape:
            raise ValueError(
                f"a search distribution needs a mean (D,) and a covariance (D, D), "
                f"not {self.mean.shape} and {self.covariance.shape}"
            )

    @classmethod
    def around(cls, mean: np.ndarray, std: float | np.ndarray) -> Self:
        """Independent parameters around a mean (D,); `std`: common standard deviation, or (D,)."""
        return cls(np.array(mean, dtype=float), np.diag(np.broadcast_to(std, np.shape(mean)) ** 2.0))


def sample(distribution: SearchDistribution, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw policies (algorithm IV.3, line 7); with equal generators, fewer are a prefix of more.

    Raises ValueError: the covariance is not positive definite.
    """
    white = rng.standard_normal((count, len(distribution.mean)))
    return distribution.mean + white @ covariance_factor(distribution.covariance).T


def cost_to_go(costs: np.ndarray, horizon: float = 1.0) -> np.ndarray:
    """S_k,t = sum of J_k,j over j from t to the end (algorithm IV.4, line 5, with j for its second t).

    `costs`: (K, T). `horizon`: share of the steps over which costs are summed, at least one step. Returns
    (K, T); rollouts with a NaN or an infinite cost are so from the first step on.
    """
    steps = costs.shape[1]
    reach = max(1, round(horizon * steps))
    with np.errstate(over="ignore", invalid="ignore"):
        ahead = np.cumsum(costs[:, ::-1], axis=1)[:, ::-1]
        beyond = np.pad(ahead[:, reach:], ((0, 0), (0, reach)))
        return ahead - beyond


def time_weights(steps: int) -> np.ndarray:
    """(T, T - 1, ..., 1) over their sum (algorithm IV.4, lines 9, 10): early steps matter more."""
    return np.arange(steps, 0.0, -1.0) * (2.0 / (steps * (steps + 1.0)))


def update(
    distribution: SearchDistribution,
    samples: np.ndarray,
    costs: np.ndarray,
    parameters: PI2Parameters,
    activation: np.ndarray | None = None,
) -> SearchDistribution:
    """One update of the search distribution (algorithm IV.4).

    `samples`: (K, D) parameters of the executed policies. `costs`: (K, T) cost per rollout and time step, in
    any unit; a rollout with NaN or infinity is left out. `activation`: (T, D) how strongly each parameter
    acts at every time step, non-negative, positive somewhere, in any unit; for `per_weight` averaging. None:
    all act equally at all times. Raises ValueError: shapes do not fit, a sample is not finite, fewer than two
    rollouts have finite costs, or the covariance is not positive definite.
    """
    _check_shapes(distribution, samples, costs, activation)
    ahead = cost_to_go(costs, parameters.horizon)
    valid = np.isfinite(ahead[:, 0])
    if valid.sum() < FEWEST_ROLLOUTS:
        raise ValueError(
            f"{valid.sum()} of {len(costs)} rollouts have finite costs, an update needs {FEWEST_ROLLOUTS}"
        )
    weights = sample_weights(ahead[valid], samples.shape[1], parameters, activation)
    deviations = samples[valid] - distribution.mean
    return SearchDistribution(
        distribution.mean + np.sum(weights * deviations, axis=0),
        adapted_covariance(distribution.covariance, deviations, weights, parameters.covariance),
    )


def sample_weights(
    ahead: np.ndarray, dimensions: int, parameters: PI2Parameters, activation: np.ndarray | None = None
) -> np.ndarray:
    """Weights (K, D) of the samples in the new mean, per parameter; they sum to 1 over the samples.

    `ahead`: (K, T) finite costs-to-go. `dimensions`: D. `activation`: see `update`.
    """
    relative, steps = normalised_costs(ahead), ahead.shape[1]
    if parameters.temperature is None:
        temperatures = bounded_temperatures(relative, parameters.kl_bound, parameters.temperature_floor)
    else:
        temperatures = np.full(steps, parameters.temperature)
    over_time = np.tile(time_weights(steps)[:, None], dimensions)  # (T, D)
    if activation is not None and parameters.averaging == "per_weight":
        over_time = over_time * activation
        over_time /= over_time.sum(axis=0)
    # summed over time by numpy, because the last bits of a matrix product depend on the number of threads
    return np.einsum("kt,td->kd", probabilities(relative, temperatures), over_time, order="C")


def _check_shapes(
    distribution: SearchDistribution, samples: np.ndarray, costs: np.ndarray, activation: np.ndarray | None
) -> None:
    if samples.ndim != 2 or costs.ndim != 2 or len(samples) != len(costs) or costs.shape[1] == 0:
        raise ValueError(
            f"an update needs samples (K, D) and costs (K, T) of the same K, "
            f"not {samples.shape} and {costs.shape}"
        )
    if samples.shape[1] != len(distribution.mean):
        raise ValueError(
            f"the samples have {samples.shape[1]} parameters, the distribution has {len(distribution.mean)}"
        )
    if not np.isfinite(samples).all():
        raise ValueError("a sample of the search distribution is not finite")
    expected = (costs.shape[1], samples.shape[1])
    if activation is not None and activation.shape != expected:
        raise ValueError(f"the activation must be (T, D), here {expected}, not {activation.shape}")


def normalised_costs(costs: np.ndarray) -> np.ndarray:
    """Normalise finite costs (K, T) per time step from [lowest, highest] to [0, 1]; 0 if all are equal."""
    lowest, highest = costs.min(axis=0), costs.max(axis=0)
    # halved, because the difference of two finite numbers may overflow
    half_range = highest / 2 - lowest / 2
    differ = half_range > ROUNDING * np.maximum(abs(lowest), abs(highest))
    return np.where(differ, (costs / 2 - lowest / 2) / np.where(differ, half_range, 1.0), 0.0)


def probabilities(costs: np.ndarray, temperatures: np.ndarray) -> np.ndarray:
    """Weights of the samples at every time step (algorithm IV.4, line 6).

    `costs`: (K, T), with minimum 0 at each time step. `temperatures`: (T,) positive, in the costs' unit.
    Returns (K, T), non-negative, summing to 1 over the samples.
    """
    weights = np.exp(-costs / temperatures)
    return weights / weights.sum(axis=0)


def bounded_temperatures(costs: np.ndarray, kl_bound: float, floor: float) -> np.ndarray:
    """Lowest temperatures at which the weights stay within a divergence from uniform weights.

    The root of KL(lambda) = bound is the minimum of the dual of relative-entropy policy search:

        g(lambda) = lambda bound + lambda log(mean_k exp(-S_k / lambda)),    dg/dlambda = bound - KL(lambda)

    `costs`: (K, T) normalised costs, with minimum 0 at each time step, at most 1. `kl_bound`: largest
    divergence in nat; never reached above log K. `floor`: smallest temperature, used where the bound allows
    less (too few samples, or ties). Returns (T,) temperatures; the divergence equals the bound wherever the
    temperature is above the floor.
    """
    return _bounded_temperatures(np.ascontiguousarray(costs.T), kl_bound, floor)


@numba.njit(cache=True)
def _bounded_temperatures(costs: np.ndarray, kl_bound: float, floor: float) -> np.ndarray:
    """`bounded_temperatures` for costs (T, K), each time step starting from the solution of the one before.

    Newton's method with a bracket, in x = log(1 / lambda).
    """
    steps, samples = costs.shape
    temperatures = np.full(steps, floor)
    coldest = -np.log(floor)
    # KL is the integral of b var_b(S) over b = 1 / lambda; a variance on [0, 1] is at most 1/4, so KL <= b^2
    # / 8
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
    """KL divergence of the weights of costs (K,) from uniform weights, and its derivative by x."""
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
    """Newton step for the logit of KL / log K, which is nearly linear in x; NaN if there is none."""
    missing = most - divergence
    if divergence <= 0.0 or missing <= 0.0 or slope <= 0.0:
        return np.nan
    excess = np.log(divergence / missing) - np.log(kl_bound / (most - kl_bound))
    return x - excess * divergence * missing / (slope * most)
