"""Path integral policy improvement with covariance adaptation, PI2-CMA (dissertation IV.7.2, algorithm IV.4).

Any episodic policy can be searched: draw parameters, roll each out, hand in the costs of every time step.

    policies = sample(distribution, parameters.samples, rng)        # (K, D)
    costs = ...                                                     # (K, T), a row per rollout
    distribution = update(distribution, policies, costs, parameters, activation)

Every time step weighs the samples by their cost-to-go. As published, these weights are averaged over time,
early steps counting most, and the average moves all parameters of a policy. But the weight of a phase kernel
acts only while its kernel is active: earlier costs say nothing about it, and much later ones little, since a
movement primitive forgets. As in PI2's original form (Theodorou, Buchli and Schaal, 2010) the average can be
taken for each parameter over the time steps at which it acts, and the cost-to-go ends at a horizon: this is
what a search gains by seeing the cost of every time step.

A rollout without a finite cost-to-go (it diverged, returned NaN, or its process died) has weight 0 at all
time steps, as if its cost were infinite. With the worst cost of the others it would draw the mean towards
itself where the others are all alike. A diverged rollout must return NaN or infinity, not a huge number:
beside that, normalised by the range, all other costs would be equal.

The weights are a softmax of the costs-to-go of each time step, P_k,t = exp(-S_k,t / lambda_t) / sum_k of it.
The text leaves lambda open. Here it is fixed, or, as in relative-entropy policy search, the lowest one whose
weights stay within a Kullback-Leibler divergence from the uniform weights: how greedy an update may be,
without knowing the scale of the costs.

    Sigma_ml = sum_t w_t sum_k P_k,t (theta_k - theta)(theta_k - theta)^T

Around the old mean theta the estimate of the covariance does not shrink on its own (weights that do not
depend on the samples return the old one on average) and grows along a direction in which all good samples
lie, as in CMA-ES. A few rollouts cannot estimate the 325 unknowns of a covariance of 25 weights, as `full`
(published) tries; they can tell 25 variances (`per_weight`), or their common size (`rescaled`).
"""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from pydantic import Field
from scipy.linalg import solve_triangular

from structlearn.core.compilation import numba
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters

RIDGE = 1e-12
"""Share of the mean variance added to a full estimate, which stays positive definite in floating point where
one direction has become very much narrower than another."""

TOLERANCE = 1e-10  # of the divergence, relative to its bound, which is at least 1e-6 because of rounding
MOST_TRIALS = 400  # every eighth halves the bracket, so this is always enough; three to six are usual
ROUNDING = 1e-12  # costs at one time step that differ by less, relative to their size, are equal


class CovarianceParameters(Parameters):
    """How the covariance follows the good samples."""

    # `per_weight`: the old covariance, each parameter's standard deviation times the root of (sum_k w_k,d
    # (theta_k,d - theta_d)^2 / Sigma_dd)^(1 / damping); `rescaled`: the old covariance times
    # (tr(Sigma_old^-1 Sigma_ml) / D)^(1 / damping); `full`: Sigma_ml, as in the text; `kept`: the old
    # covariance
    mode: Literal["per_weight", "rescaled", "full", "kept"]
    damping: float = Field(ge=1)  # of `per_weight` and `rescaled`; 1 is none
    # of all but `kept`: smallest ratio of new to old variance of a parameter or in any direction. Without it
    # `full` gives up every direction that the samples happen to miss; near 1 it lets the covariance grow,
    # because then chance only widens.
    eigenvalue_floor: float = Field(gt=0, le=1)


def covariance_factor(covariance: np.ndarray) -> np.ndarray:
    """Lower Cholesky factor of a covariance (D, D); InputError where it is not positive definite."""
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise InputError("the covariance of the search distribution is not positive definite") from error


def adapted_covariance(
    old: np.ndarray, deviations: np.ndarray, weights: np.ndarray, parameters: CovarianceParameters
) -> np.ndarray:
    """New covariance (D, D), symmetric and positive definite.

    `rescaled` and `full` find it in coordinates in which the old covariance is the unit matrix, so that a
    linear change of the policy's parameters changes nothing; they weigh a sample alike in all parameters.
    `old`: (D, D) covariance of the samples. `deviations`: (K, D) samples minus the old mean. `weights`:
    (K, D), sum over the samples 1. Raises InputError: the old covariance is not positive definite.
    """
    if parameters.mode == "kept":
        return old
    root, floor = covariance_factor(old), parameters.eigenvalue_floor
    if parameters.mode == "per_weight":
        ratios = np.sum(weights * deviations**2, axis=0) / np.diag(old)
        scale = np.sqrt(np.maximum(ratios ** (1.0 / parameters.damping), floor))
        return scale[:, None] * old * scale
    shared = weights.mean(axis=1)  # (K,), all of a sample's weights where the text averages
    white = solve_triangular(root, deviations.T, lower=True, check_finite=False)  # (D, K)
    if parameters.mode == "rescaled":
        ratio = np.sum(white * white * shared) / len(old)
        return max(ratio ** (1.0 / parameters.damping), floor) * old
    ratios, directions = np.linalg.eigh((white * shared) @ white.T)
    spread = (root @ directions) * np.sqrt(np.maximum(ratios, floor))
    full = spread @ spread.T
    full[np.diag_indices_from(full)] += RIDGE * np.trace(full) / len(full)
    return full


FEWEST_ROLLOUTS = 2  # One rollout says nothing of what is better


class PI2Parameters(Parameters):
    """How the search distribution is sampled and updated. Fields: `params.yaml`, `refine.search`."""

    samples: int = Field(ge=FEWEST_ROLLOUTS)
    averaging: Literal["per_weight", "per_policy"]
    horizon: float = Field(gt=0, le=1)
    kl_bound: float = Field(ge=1e-6)
    temperature: float | None = Field(ge=1e-9)
    temperature_floor: float = Field(ge=1e-9)
    covariance: CovarianceParameters


@dataclass(frozen=True)
class SearchDistribution:
    """Gaussian over policies."""

    mean: np.ndarray  # (D,) parameters of a policy, in their own unit
    covariance: np.ndarray  # (D, D) symmetric and positive definite

    def __post_init__(self) -> None:
        if self.mean.ndim != 1 or self.covariance.shape != 2 * self.mean.shape:
            raise InputError(
                f"a search distribution needs a mean (D,) and a covariance (D, D), "
                f"not {self.mean.shape} and {self.covariance.shape}"
            )

    @classmethod
    def around(cls, mean: np.ndarray, std: float | np.ndarray) -> Self:
        """Independent parameters around a mean (D,); `std`: standard deviation of all, or (D,) of each."""
        return cls(np.array(mean, dtype=float), np.diag(np.broadcast_to(std, np.shape(mean)) ** 2.0))


def sample(distribution: SearchDistribution, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw policies (algorithm IV.3, line 7); fewer from an equal generator are the first of more.

    Raises InputError: the covariance is not positive definite.
    """
    white = rng.standard_normal((count, len(distribution.mean)))
    return distribution.mean + white @ covariance_factor(distribution.covariance).T


def cost_to_go(costs: np.ndarray, horizon: float = 1.0) -> np.ndarray:
    """S_k,t = sum of J_k,j over j from t to the end (algorithm IV.4, line 5, with j for its second t).

    `costs`: (K, T). `horizon`: share of the steps that a sum reaches, at least one step. Returns (K, T); NaN
    or infinite at the first step where any is.
    """
    steps = costs.shape[1]
    reach = max(1, round(horizon * steps))
    with np.errstate(over="ignore", invalid="ignore"):
        ahead = np.cumsum(costs[:, ::-1], axis=1)[:, ::-1]
        beyond = np.pad(ahead[:, reach:], ((0, 0), (0, reach)))
        return ahead - beyond


def time_weights(steps: int) -> np.ndarray:
    """T, T - 1, ..., 1 over their sum (algorithm IV.4, lines 9, 10): early steps have more to decide."""
    return np.arange(steps, 0.0, -1.0) * (2.0 / (steps * (steps + 1.0)))


def update(
    distribution: SearchDistribution,
    samples: np.ndarray,
    costs: np.ndarray,
    parameters: PI2Parameters,
    activation: np.ndarray | None = None,
) -> SearchDistribution:
    """One update of the search distribution (algorithm IV.4).

    `samples`: (K, D) parameters of the rolled-out policies. `costs`: (K, T) cost per rollout and time step,
    any unit; a rollout with a NaN or infinity is left out. `activation`: (T, D) how much each parameter acts
    at every time step, not negative, somewhere positive, any unit; for `per_weight` averaging. None: all act
    alike at all times. Raises InputError: shapes do not fit, a sample is not finite, fewer than two rollouts
    have finite costs, or the covariance of the distribution is not positive definite.
    """
    _check_shapes(distribution, samples, costs, activation)
    ahead = cost_to_go(costs, parameters.horizon)
    valid = np.isfinite(ahead[:, 0])
    if valid.sum() < FEWEST_ROLLOUTS:
        raise InputError(
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
    """Weights (K, D) of the samples in the new mean, per parameter; sum over the samples 1.

    `ahead`: (K, T) finite costs-to-go. `dimensions`: D. `activation`: see `update`.
    """
    relative, steps = normalised(ahead), ahead.shape[1]
    if parameters.temperature is None:
        temperatures = bounded_temperatures(relative, parameters.kl_bound, parameters.temperature_floor)
    else:
        temperatures = np.full(steps, parameters.temperature)
    over_time = np.tile(time_weights(steps)[:, None], dimensions)  # (T, D)
    if activation is not None and parameters.averaging == "per_weight":
        over_time = over_time * activation
        over_time /= over_time.sum(axis=0)
    # summed over time by numpy: the last bits of a long matrix product depend on the number of threads
    return np.einsum("kt,td->kd", probabilities(relative, temperatures), over_time, order="C")


def _check_shapes(
    distribution: SearchDistribution, samples: np.ndarray, costs: np.ndarray, activation: np.ndarray | None
) -> None:
    if samples.ndim != 2 or costs.ndim != 2 or len(samples) != len(costs) or costs.shape[1] == 0:
        raise InputError(
            f"an update needs samples (K, D) and costs (K, T) of the same K, "
            f"not {samples.shape} and {costs.shape}"
        )
    if samples.shape[1] != len(distribution.mean):
        raise InputError(
            f"the samples have {samples.shape[1]} parameters, the distribution has {len(distribution.mean)}"
        )
    if not np.isfinite(samples).all():
        raise InputError("a sample of the search distribution is not finite")
    expected = (costs.shape[1], samples.shape[1])
    if activation is not None and activation.shape != expected:
        raise InputError(f"the activation must be (T, D), here {expected}, not {activation.shape}")


def normalised(costs: np.ndarray) -> np.ndarray:
    """Finite costs (K, T) mapped from [lowest, highest over the samples] to [0, 1] at every time step.

    They are 0 where all samples cost the same.
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
    """Newton's step for the logit of KL / log K, nearly a straight line in x; NaN where there is none."""
    missing = most - divergence
    if divergence <= 0.0 or missing <= 0.0 or slope <= 0.0:
        return np.nan
    excess = np.log(divergence / missing) - np.log(kl_bound / (most - kl_bound))
    return x - excess * divergence * missing / (slope * most)
