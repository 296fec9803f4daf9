"""Sample efficiency of the policy search: PI2-CMA against plain CMA-ES, with the same budget of rollouts.

Both search the weights of an open-loop policy from the same normal distribution, without training in between.
PI2-CMA sees the cost of every time step, CMA-ES the sum. CMA-ES is its authors' package `cma` with its
default population size. The n-th rollouts with equal seeds have the same conditions, and both methods start
with the same random numbers.

Only whole updates are made; the rest of the budget is unused. Failed rollouts count. PI2-CMA leaves them out;
for CMA-ES, which only ranks, they are the worst.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Self

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.feedback.models.pmnn import open_loop
from structlearn.policy_search import pi2
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution
from structlearn.policy_search.refinement import (
    Environment,
    Rollout,
    cost_matrix,
    kernel_activation,
    succeeded,
)

if TYPE_CHECKING:
    import cma

PI2, CMA_ES = "pi2", "cma_es"  # names of the methods

SEARCHED, JUDGED = 3, 4
"""Second numbers of the rollouts' seeds, for updates and for mean policies; 0 to 2 are the refinement's."""


class ComparisonParameters(Parameters):
    """Budget and seeds of the comparison of searches."""

    budget: int = Field(ge=1)
    seeds: int = Field(ge=1)
    evaluation_runs: int = Field(ge=1)


@dataclass
class PathIntegralSearch:
    """PI2-CMA (algorithm IV.4), with the same methods as `EvolutionStrategy`."""

    distribution: SearchDistribution  # of the next policies
    parameters: PI2Parameters
    rng: np.random.Generator

    @property
    def count(self) -> int:
        """Rollouts per update K."""
        return self.parameters.samples

    @property
    def mean(self) -> np.ndarray:
        """(N,) weights of the mean policy."""
        return self.distribution.mean

    def propose(self) -> np.ndarray:
        """(K, N) weights of the policies to execute."""
        return pi2.sample(self.distribution, self.count, self.rng)

    def learn(self, policies: np.ndarray, runs: Sequence[Rollout]) -> None:
        """Update by the costs per tick; failed rollouts are left out."""
        costs = cost_matrix(runs)
        activation = kernel_activation(costs.shape[1], len(self.mean))
        self.distribution = pi2.update(self.distribution, policies, costs, self.parameters, activation)


@dataclass
class EvolutionStrategy:
    """Plain CMA-ES of the package `cma`."""

    strategy: "cma.CMAEvolutionStrategy"

    @classmethod
    def around(cls, mean: np.ndarray, std: float, rng: np.random.Generator) -> Self:
        """Start with independent weights around a mean (N,); `rng` replaces numpy's global generator."""
        import cma

        options = {
            "randn": lambda count, size: rng.standard_normal((count, size)),
            "seed": np.nan,  # leaves the global generator alone
            "verbose": -10,  # no printing, no options read from the working directory
            "verb_log": 0,  # no files
        }
        return cls(cma.CMAEvolutionStrategy(mean, std, options))

    @property
    def count(self) -> int:
        """Rollouts per update K = 4 + floor(3 log N)."""
        return self.strategy.popsize

    @property
    def mean(self) -> np.ndarray:
        """(N,) weights of the mean policy."""
        return np.array(self.strategy.mean)

    def propose(self) -> np.ndarray:
        """(K, N) weights of the policies to execute."""
        return np.array(self.strategy.ask())

    def learn(self, policies: np.ndarray, runs: Sequence[Rollout]) -> None:
        """Update by the accumulated costs; failed rollouts rank behind all others."""
        costs = np.array([_accumulated(run) for run in runs])
        behind = np.nanmax(costs) + 1.0  # finite, as the package requires; only the order matters
        self.strategy.tell(list(policies), np.where(np.isnan(costs), behind, costs).tolist())


Search = PathIntegralSearch | EvolutionStrategy


@dataclass
class Trial:
    """One search and its results so far."""

    method: str
    seed: int  # of its random numbers and of its rollouts' conditions
    search: Search
    # accumulated cost of every rollout so far in rad, NaN if it failed
    costs: list[float] = field(default_factory=list)
    means: list[np.ndarray] = field(default_factory=list)  # (N,) mean policy after every update so far


def compare_searches(
    environment: Environment,
    start: np.ndarray,
    exploration: float,
    search: PI2Parameters,
    parameters: ComparisonParameters,
    first_seed: int = 0,
) -> pd.DataFrame:
    """Run all searches in lock-step from a policy `start` (N,), and evaluate their mean policies.

    One row per `method`, `seed` and `update` (0 is the start): `rollouts` (used so far), `cost_rad`
    (accumulated, mean over executions of the mean policy under conditions that are the same in all rows; NaN
    if one failed), `best_rad` (lowest accumulated cost of any rollout so far; NaN at the start), `failed`
    (rollouts so far). Raises InputError: the budget is less than one update, or fewer than two rollouts of an
    update succeeded.
    """
    trials = []
    for method, seed in product((PI2, CMA_ES), range(first_seed, first_seed + parameters.seeds)):
        rng = np.random.default_rng(seed)
        own: Search
        if method == PI2:
            own = PathIntegralSearch(SearchDistribution.around(start, exploration), search, rng)
        else:
            own = EvolutionStrategy.around(start, exploration, rng)
        if own.count > parameters.budget:
            raise InputError(
                f"a budget of {parameters.budget} rollouts is not enough for an update of {method}, "
                f"which takes {own.count}"
            )
        trials.append(Trial(method, seed, own))
    while going := [one for one in trials if len(one.costs) + one.search.count <= parameters.budget]:
        _advance(environment, going)
    policies = [start, *(mean for trial in trials for mean in trial.means)]
    before, *after = _mean_costs(environment, policies, parameters.evaluation_runs)
    costs = iter(after)
    tables = [_rows(trial, [before, *(next(costs) for _ in trial.means)]) for trial in trials]
    return pd.concat(tables, ignore_index=True)


def _advance(environment: Environment, trials: Sequence[Trial]) -> None:
    """One update of every search; their rollouts are executed in one call, to use all cores."""
    proposed = [trial.search.propose() for trial in trials]
    seeds = [
        (trial.seed, SEARCHED, len(trial.costs) + number)
        for trial, policies in zip(trials, proposed, strict=True)
        for number in range(len(policies))
    ]
    runs = environment.rollouts([open_loop(policy) for policy in np.vstack(proposed)], seeds)
    for trial, policies in zip(trials, proposed, strict=True):
        own, runs = runs[: len(policies)], runs[len(policies) :]
        update = len(trial.means) + 1
        succeeded(own, f"rollouts of {trial.method}, seed {trial.seed}, update {update}", pi2.FEWEST_ROLLOUTS)
        trial.search.learn(policies, own)
        trial.costs += [_accumulated(run) for run in own]
        trial.means.append(trial.search.mean)


def _accumulated(run: Rollout) -> float:
    """Cost of the whole primitive in rad; NaN if it failed."""
    return float(np.sum(run.cost)) if not run.fault else np.nan


def _mean_costs(environment: Environment, policies: Sequence[np.ndarray], count: int) -> list[float]:
    """Mean accumulated cost of each policy over executions under the same conditions."""
    networks = [open_loop(policy) for policy in policies for _ in range(count)]
    seeds = [(0, JUDGED, number) for _ in policies for number in range(count)]
    costs = [_accumulated(run) for run in environment.rollouts(networks, seeds)]
    return np.reshape(costs, (len(policies), count)).mean(axis=1).tolist()


def _rows(trial: Trial, mean_costs: Sequence[float]) -> pd.DataFrame:
    used = [update * trial.search.count for update in range(len(mean_costs))]
    return pd.DataFrame(
        {
            "method": trial.method,
            "seed": trial.seed,
            "update": range(len(mean_costs)),
            "rollouts": used,
            "cost_rad": mean_costs,
            "best_rad": [np.nanmin(trial.costs[:count]) if count else np.nan for count in used],
            "failed": [int(np.isnan(trial.costs[:count]).sum()) for count in used],
        }
    )
