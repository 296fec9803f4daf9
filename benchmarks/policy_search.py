"""PI2-CMA updates of a search distribution, beside CMA-ES.

The library `cma` does other mathematics for the same purpose: it ranks the samples, learns a full covariance
and a step size. Each is held against its own definition: ours with the temperature from scipy's minimum of
the dual, `cma` by its weighted recombination of the samples.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar
from timing import Case, Contender

from structlearn.core.params import read_parameters
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution, sample, update

SEED = 4
SAMPLES, DIMENSIONS = 38, 75  # 25 weights of three axes
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

    return Case(
        work="  with the samples drawn",
        ours=Contender(run, error),
        peers={"cma ask and tell": peer_cma},
        tolerance=TOLERANCE,
        note="cma learns a full covariance, ours variances; costs of one time step",
    )


def peer_cma() -> Contender:
    """The same loop of CMA-ES."""
    from cma import CMAEvolutionStrategy

    strategy = CMAEvolutionStrategy(
        np.zeros(DIMENSIONS), 1.0, {"popsize": SAMPLES, "seed": SEED, "verbose": -9}
    )

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
