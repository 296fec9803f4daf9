"""PI2-CMA updates of a search distribution, beside CMA-ES.

The libraries `cma` and `cmaes` do other mathematics for the same purpose: they rank the samples and learn a
step size, beside a full covariance or, as ours, variances (`CMA_diagonal`, `SepCMA`). Each is held against
its own definition: ours with the temperature from scipy's minimum of the dual, the others by their weighted
recombination of the samples. What an update costs is one thing, how many samples a search needs another: the
note counts them.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar
from timing import Case, Contender

from structlearn.core.params import read_parameters
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution, sample, update
from structlearn.policy_search.refinement import kernel_activation

SEED = 4
AXES, SAMPLES = 3, 38
DIMENSIONS = 25 * AXES  # weights
PATH_SAMPLES = 100
GOAL, SEARCHED, MOST_SAMPLES = 0.05, 11, 200 * SAMPLES  # share of the cost at the start; seeds; samples
PARAMETERS = read_parameters(
    Path(__file__).parents[1] / "params.yaml", "refine.search", PI2Parameters
).model_copy(update={"samples": SAMPLES})
TOLERANCE = 1e-4  # of scipy's minima


def update_once(work: str, steps: int, aim_ms: float | None) -> Case:
    """Update from samples whose costs are known at so many time steps."""
    distribution = SearchDistribution.around(np.zeros(DIMENSIONS), 1.0)
    policies = sample(distribution, SAMPLES, np.random.default_rng(SEED))
    costs = _costs(policies, steps)
    mean, variances = reference(policies, costs)
    return Case(
        work=work,
        ours=Contender(
            lambda: update(distribution, policies, costs, PARAMETERS),
            partial(_error, mean=mean, variances=variances),
        ),
        aim_ms=aim_ms,
        tolerance=TOLERANCE,
        note="temperature by the KL bound at each time step, a variance per weight",
    )


def draw_and_update() -> Case:
    """What a search does beside its rollouts: draw samples, update from one cost each."""
    distribution = SearchDistribution.around(np.zeros(DIMENSIONS), 1.0)
    rng = np.random.default_rng(SEED)

    def run() -> tuple[np.ndarray, SearchDistribution]:
        policies = sample(distribution, SAMPLES, rng)
        return policies, update(distribution, policies, _costs(policies, 1), PARAMETERS)

    def error(result: tuple[np.ndarray, SearchDistribution]) -> float:
        policies, found = result
        return _error(found, *reference(policies, _costs(policies, 1)))

    needed = "; ".join(f"{name} {samples_to_goal(build)}" for name, build in SEARCHES.items())
    return Case(
        work="  with the samples drawn",
        ours=Contender(run, error),
        peers={
            "cma, full covariance": lambda: peer_cma(full=True),
            "cma, CMA_diagonal": lambda: peer_cma(full=False),
            "cmaes SepCMA": peer_sepcma,
        },
        tolerance=TOLERANCE,
        note="costs of one time step; all but cma's full covariance learn variances. Both of our searches "
        "are told when each weight acts, which no other can be. Samples until the mean follows "
        f"a path of {AXES} axes with {GOAL:g} of the cost at the start, median of {SEARCHED} seeds: {needed}",
    )


def peer_cma(full: bool) -> Contender:
    """The same loop of CMA-ES by `cma`."""
    strategy = _cma(full, SEED)

    def run() -> tuple[np.ndarray, np.ndarray]:
        policies = np.array(strategy.ask())
        strategy.tell(policies, _costs(policies, 1)[:, 0])
        return policies, strategy.mean

    def error(result: tuple[np.ndarray, np.ndarray]) -> float:
        policies, mean = result
        weights = strategy.sp.weights.positive_weights
        best = policies[np.argsort(_costs(policies, 1)[:, 0], kind="stable")[: len(weights)]]
        return abs(weights @ best - mean).max() / abs(mean).max()

    return Contender(run, error)


def peer_sepcma() -> Contender:
    """The same loop of separable CMA-ES by `cmaes`, which takes one policy at a time."""
    strategy = _sepcma(SEED)

    def run() -> tuple[np.ndarray, np.ndarray]:
        policies = np.array([strategy.ask() for _ in range(SAMPLES)])
        costs = _costs(policies, 1)[:, 0]
        strategy.tell(list(zip(policies, costs, strict=True)))
        return policies, strategy.mean.copy()  # it is a view

    def error(result: tuple[np.ndarray, np.ndarray]) -> float:
        policies, mean = result
        best = policies[np.argsort(_costs(policies, 1)[:, 0], kind="stable")[: SAMPLES // 2]]
        weights = np.log(SAMPLES // 2 + 1) - np.log(np.arange(1, SAMPLES // 2 + 1))
        return abs(weights @ best / weights.sum() - mean).max() / abs(mean).max()

    return Contender(run, error)


def _cma(full: bool, seed: int) -> Any:
    from cma import CMAEvolutionStrategy

    options = {"popsize": SAMPLES, "seed": seed, "verbose": -9, "CMA_diagonal": not full}
    return CMAEvolutionStrategy(np.zeros(DIMENSIONS), 1.0, options)


def _sepcma(seed: int) -> Any:
    from cmaes import SepCMA

    return SepCMA(np.zeros(DIMENSIONS), 1.0, seed=seed, population_size=SAMPLES)


class Search(NamedTuple):
    """A search from a mean of 0 and a standard deviation of 1."""

    ask: Callable[[], np.ndarray]  # policies (K, D)
    tell: Callable[[np.ndarray, np.ndarray], np.ndarray]  # with their costs (K, T); returns the new mean


def _by_pi2(seed: int, steps: int) -> Search:
    """Ours, from costs summed over so many stretches of time; 1: one cost for each policy."""
    current, rng = SearchDistribution.around(np.zeros(DIMENSIONS), 1.0), np.random.default_rng(seed)
    acting = np.tile(kernel_activation(PATH_SAMPLES), AXES).reshape(steps, -1, DIMENSIONS).sum(axis=1)

    def tell(policies: np.ndarray, costs: np.ndarray) -> np.ndarray:
        nonlocal current
        stretches = costs.reshape(len(costs), steps, -1).sum(axis=2)
        current = update(current, policies, stretches, PARAMETERS, acting)
        return current.mean

    return Search(lambda: sample(current, SAMPLES, rng), tell)


def _by_cma(seed: int, full: bool) -> Search:
    strategy = _cma(full, seed)

    def tell(policies: np.ndarray, costs: np.ndarray) -> np.ndarray:
        strategy.tell(policies, costs.sum(axis=1))
        return strategy.mean

    return Search(lambda: np.array(strategy.ask()), tell)


def _by_sepcma(seed: int) -> Search:
    strategy = _sepcma(seed)

    def tell(policies: np.ndarray, costs: np.ndarray) -> np.ndarray:
        strategy.tell(list(zip(policies, costs.sum(axis=1), strict=True)))
        return strategy.mean

    return Search(lambda: np.array([strategy.ask() for _ in range(SAMPLES)]), tell)


SEARCHES: Mapping[str, Callable[[int], Search]] = {
    "ours with costs over time": partial(_by_pi2, steps=PATH_SAMPLES),
    "ours with one cost": partial(_by_pi2, steps=1),
    "cma, full covariance": partial(_by_cma, full=True),
    "cma, CMA_diagonal": partial(_by_cma, full=False),
    "cmaes SepCMA": _by_sepcma,
}


def samples_to_goal(build: Callable[[int], Search]) -> str:
    """Median number of samples of a search until its mean is at the goal; a word if it is not reached."""
    try:
        needed = [_samples_to_goal(build(seed), seed) for seed in range(1, SEARCHED + 1)]
    except ImportError:
        return "not installed"
    median = np.median(needed)
    return f"{median:.0f}" if np.isfinite(median) else f"not within {MOST_SAMPLES}"


def _samples_to_goal(search: Search, seed: int) -> float:
    """Of one seed, which also draws the path: its weights are as far away as the first samples reach."""
    wanted = np.random.default_rng([SEED, seed]).normal(size=DIMENSIONS)
    features = kernel_activation(PATH_SAMPLES)

    def costs(policies: np.ndarray) -> np.ndarray:
        apart = (policies - wanted).reshape(-1, AXES, features.shape[1])
        return np.square(apart @ features.T).sum(axis=1)  # (K, T)

    goal = GOAL * costs(np.zeros((1, DIMENSIONS))).sum()
    for drawn in range(SAMPLES, MOST_SAMPLES + 1, SAMPLES):
        policies = search.ask()
        if costs(search.tell(policies, costs(policies))[None]).sum() <= goal:
            return drawn
    return np.inf


def reference(policies: np.ndarray, costs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """New mean and variances, from an old distribution of mean 0 and unit covariance; all act always."""
    steps, own = costs.shape[1], PARAMETERS.covariance
    reach = max(1, round(PARAMETERS.horizon * steps))
    mean, square = np.zeros((2, policies.shape[1]))
    for t in range(steps):
        ahead = costs[:, t : t + reach].sum(axis=1)
        ahead = (ahead - ahead.min()) / np.ptp(ahead)

        def dual(temperature: float, ahead: np.ndarray = ahead) -> float:
            return temperature * (PARAMETERS.kl_bound + np.log(np.mean(np.exp(-ahead / temperature))))

        temperature = minimize_scalar(dual, bounds=(PARAMETERS.temperature_floor, 1.0), method="bounded").x
        weights = np.exp(-ahead / temperature)
        weights *= 2.0 * (steps - t) / (steps * (steps + 1)) / weights.sum()
        mean += weights @ policies
        square += weights @ policies**2
    return mean, np.maximum(square ** (1.0 / own.damping), own.eigenvalue_floor)


def _costs(policies: np.ndarray, steps: int) -> np.ndarray:
    """Costs over time that drift with the first parameters: a row per policy."""
    waves = np.cos(np.arange(1, 6)[:, None] * np.linspace(0.0, np.pi, steps))
    return (1.0 + policies[:, :5] @ waves / 5.0) ** 2


def _error(found: SearchDistribution, mean: np.ndarray, variances: np.ndarray) -> float:
    wide = abs(np.diag(found.covariance) / variances - 1.0).max()
    return max(abs(found.mean - mean).max() / abs(mean).max(), wide)


CASES: tuple[Callable[[], Case], ...] = (
    lambda: update_once(f"PI2-CMA update {SAMPLES} x {DIMENSIONS}", 1, 0.3),
    lambda: update_once("  with costs of 1000 time steps", 1000, None),
    draw_and_update,
)
