"""Reinforcement learning of a feedback model in a new setting (dissertation IV.7, algorithm IV.3).

    1. execute with the current network; then repeat:
    2. compress the executions into an open-loop policy, one weight per phase kernel
    3. draw policies around it, execute each, and update the policy by PI2-CMA
    4. execute the improved policy, and add its deviations and coupling terms to the demonstrations
    5. retrain the network from the initial one on old and new data, and execute it

The search runs in the 25 weights of the policy, not in the thousands of the network, and the network keeps
the demonstrations of the old settings in its data, so it does not forget them. Primitives are refined one
after another, the earlier ones running with what they have learned.

The text stops at a threshold of the cost, whose value it does not state. Here the number of iterations is
given, which shows what later ones gain. An iteration may increase the cost, so the network of the cheapest
one is kept, and the next iteration starts from it. Every rollout is recorded, failed ones with their fault.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated, to_table
from structlearn.feedback.coupling_model import CouplingModel, module_name
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.trainers import TrainingParameters, train_final
from structlearn.policy_search import pi2
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution
from structlearn.primitives import canonical
from structlearn.primitives.kernels import KERNEL_COUNT, features

FEEDBACK, SAMPLE, IMPROVED = "feedback", "sample", "improved"
"""Kinds of rollouts: with the network, with a drawn policy, with the updated policy."""


@dataclass(frozen=True)
class Rollout:
    """One execution of the primitive being refined."""

    cost: np.ndarray  # (T,) rad per tick; all NaN if it failed
    samples: CouplingDataset | None  # supervised data; None if it failed or samples were not needed
    fault: str = ""  # reason of failure, or empty


class Environment(Protocol):
    """Where the primitive is executed; `seeds` determine the conditions of a run, reproducibly."""

    @property
    def rate_hz(self) -> float:
        """Ticks per second of the costs."""

    def rollouts(self, networks: Sequence[CouplingModel], seeds: Sequence[tuple[int, ...]]) -> list[Rollout]:
        """Execute once per network, each with its seed; failures are reported, not raised."""


def succeeded(runs: Sequence[Rollout], what: str, fewest: int = 1) -> list[Rollout]:
    """Runs without a fault. Raises InputError: too few, with the first fault."""
    done = [run for run in runs if not run.fault]
    if len(done) < fewest:
        fault = next(run.fault for run in runs if run.fault)
        raise InputError(
            f"{len(done)} of {len(runs)} {what} succeeded, {fewest} must; the first fault: {fault}"
        )
    return done


def cost_matrix(runs: Sequence[Rollout]) -> np.ndarray:
    """(K, T) costs; failed runs have NaN."""
    length = min((len(run.cost) for run in runs if not run.fault), default=1)
    return np.stack([run.cost[:length] if not run.fault else np.full(length, np.nan) for run in runs])


def kernel_activation(steps: int, kernel_count: int = KERNEL_COUNT) -> np.ndarray:
    """Activation |G_i(p, u)| (T, N) of each weight of an open-loop policy at every tick of a primitive."""
    p, u = canonical.phase(np.linspace(0.0, 1.0, steps), canonical.TAU_PER_DURATION)
    return np.abs(features(p, u, kernel_count))


def history_rows(runs: Sequence[Rollout], iteration: int, kind: str) -> pd.DataFrame:
    """One row per rollout; `cost_rad` (accumulated) and `norm_rad` are NaN if it failed."""
    rows = [
        (iteration, kind, number, float(np.sum(run.cost)), float(np.linalg.norm(run.cost)), run.fault)
        for number, run in enumerate(runs)
    ]
    return pd.DataFrame(rows, columns=["iteration", "kind", "number", "cost_rad", "norm_rad", "fault"])


def sample_rows(runs: Sequence[Rollout], iteration: int, kind: str, rate_hz: float) -> pd.DataFrame:
    """Samples of the rollouts without a fault (at least one).

    One row per sample: `iteration`, `kind`, `number`, the columns of `to_table`, and `cost_rad`, in single
    precision, since they are for figures and recordings.
    """
    keys = {"iteration": iteration, "kind": kind}
    tables = [
        to_table(run.samples).assign(
            **keys, number=number, cost_rad=run.cost[np.rint(run.samples.time * rate_hz).astype(int)]
        )
        for number, run in enumerate(runs)
        if run.samples is not None
    ]
    whole = pd.concat(tables, ignore_index=True)
    return whole.astype(dict.fromkeys(whole.select_dtypes("float64"), "float32"))


SMALLEST_SINGULAR_VALUE = 1e-4
"""Relative to the largest; smaller ones belong to kernels where the phase velocity vanishes."""

KNOWN = 5  # second number of the seeds of `executed`; 0 to 4 are the kinds of rollouts and the searches


class RefinementParameters(Parameters):
    """Refinement of a feedback model by trial. Fields: `params.yaml`, `refine`."""

    iterations: int = Field(ge=1, le=100)
    search: PI2Parameters
    evaluation_runs: int = Field(ge=1)
    added_runs: int = Field(ge=1)
    training: TrainingParameters
    retraining_dropout: float = Field(ge=0, lt=1)


@dataclass(frozen=True)
class Progress:
    """State after an iteration; all that the next one needs."""

    iteration: int  # 0 before the first update
    network: CouplingModel  # feedback model of the cheapest iteration so far
    covariance: np.ndarray  # (N, N) of the search
    history: pd.DataFrame  # all rollouts so far, see `history_rows`
    policies: np.ndarray  # (R, N) weights of the open-loop rollouts in the history's order, for inspection
    samples: pd.DataFrame  # of all rollouts so far, see `sample_rows`; for inspection
    compressed: np.ndarray  # (N,) open-loop policy equivalent to the executions with this network

    @property
    def kept(self) -> int:
        """Iteration whose network is kept: fewest failures in its executions, then lowest mean cost."""
        runs = self.history[self.history["kind"] == FEEDBACK]
        by_iteration = runs.assign(failed=runs["fault"] != "").groupby("iteration")
        standing = by_iteration.agg({"failed": "sum", "cost_rad": "mean"})
        return int(standing.sort_values(["failed", "cost_rad"], kind="stable").index[0])


def start(
    environment: Environment, initial: CouplingModel, parameters: RefinementParameters, exploration: float
) -> Progress:
    """Execute the initial network (algorithm IV.3, line 2).

    `exploration`: standard deviation of the policy's weights. Raises InputError: no execution succeeded.
    """
    count = initial.kernel_count
    runs = _execute(environment, [initial] * parameters.evaluation_runs, 0, FEEDBACK)
    return Progress(
        iteration=0,
        network=initial,
        covariance=exploration**2 * np.eye(count),
        compressed=compress(runs, count),
        history=history_rows(runs, 0, FEEDBACK),
        policies=np.empty((0, count)),
        samples=sample_rows(runs, 0, FEEDBACK, environment.rate_hz),
    )


def improve(
    environment: Environment,
    progress: Progress,
    initial: CouplingModel,
    demonstrations: CouplingDataset,
    parameters: RefinementParameters,
    seed: int,
) -> Progress:
    """One iteration of algorithm IV.3.

    `initial`: the network that retraining starts from. Raises InputError: fewer than two policies succeeded,
    or no execution of the improved policy or of the network.
    """
    iteration = progress.iteration + 1
    rng = np.random.default_rng([seed, iteration])
    distribution = SearchDistribution(progress.compressed, progress.covariance)
    policies = pi2.sample(distribution, parameters.search.samples, rng)
    tried = _execute(environment, [open_loop(policy) for policy in policies], iteration, SAMPLE)
    succeeded(tried, f"policies of iteration {iteration}", pi2.FEWEST_ROLLOUTS)
    costs = cost_matrix(tried)
    activation = kernel_activation(costs.shape[1], len(progress.compressed))
    updated = pi2.update(distribution, policies, costs, parameters.search, activation)
    mean = updated.mean
    improved = _execute(environment, [open_loop(mean)] * parameters.added_runs, iteration, IMPROVED)
    added = learnable(improved, f"executions of the improved policy of iteration {iteration}")
    retraining = parameters.training.model_copy(update={"dropout": parameters.retraining_dropout})
    data = concatenated([demonstrations, added])
    network = train_final(module_name(initial), data, retraining, initial=initial)
    runs = _execute(environment, [network] * parameters.evaluation_runs, iteration, FEEDBACK)
    groups = ((tried, SAMPLE), (improved, IMPROVED), (runs, FEEDBACK))
    rows = [history_rows(group, iteration, kind) for group, kind in groups]
    samples = [sample_rows(group, iteration, kind, environment.rate_hz) for group, kind in groups]
    advanced = replace(
        progress,
        iteration=iteration,
        covariance=updated.covariance,
        history=pd.concat([progress.history, *rows], ignore_index=True),
        policies=np.vstack([progress.policies, policies, np.tile(mean, (len(improved), 1))]),
        samples=pd.concat([progress.samples, *samples], ignore_index=True),
    )
    if advanced.kept < iteration:
        return advanced
    return replace(advanced, network=network, compressed=compress(runs, len(mean)))


def refine(
    environment: Environment,
    initial: CouplingModel,
    demonstrations: CouplingDataset,
    parameters: RefinementParameters,
    exploration: float,
    seed: int,
    report: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Refine a feedback model; `exploration`: initial std of the policy's weights.

    `report`: called with the state after every iteration, including the 0th.
    """
    progress = start(environment, initial, parameters, exploration)
    report(progress)
    while progress.iteration < parameters.iterations:
        progress = improve(environment, progress, initial, demonstrations, parameters, seed)
        report(progress)
    return progress


def executed(environment: Environment, policy: np.ndarray, runs: int) -> CouplingDataset:
    """Samples of executions of an open-loop policy (N,) in the setting for which it is right.

    In human demonstrations the sensor also feels the hand on the robot. Since the improved policy of a new
    setting is executed without a hand, so are the right policies of known settings; otherwise the network
    would mistake the difference between hand and no hand for one between settings. Raises InputError: all
    executions failed.
    """
    seeds = [(0, KNOWN, number) for number in range(runs)]
    return learnable(environment.rollouts([open_loop(policy)] * runs, seeds), "executions in a known setting")


def learnable(runs: Sequence[Rollout], what: str) -> CouplingDataset:
    """Samples of the executions without a fault (at least one), numbered -1, -2, ..."""
    samples = [run.samples for run in succeeded(runs, what) if run.samples is not None]
    numbers = np.repeat(-1 - np.arange(len(samples)), [len(part.target) for part in samples])
    return replace(concatenated(samples), demonstration=numbers)


def compress(runs: Sequence[Rollout], kernel_count: int = KERNEL_COUNT) -> np.ndarray:
    """Weights (N,) of the open-loop policy nearest to the executions on average (algorithm IV.3, line 4).

    Failed executions are left out. Raises InputError: all failed.
    """
    return open_loop_weights(learnable(runs, "executions with the network"), kernel_count)


def open_loop_weights(samples: CouplingDataset, kernel_count: int = KERNEL_COUNT) -> np.ndarray:
    """Weights theta (N,) of the policy c = G(p, u) . theta nearest to the targets, by least squares."""
    features = samples.modulation(kernel_count)
    return np.linalg.lstsq(features, samples.target, rcond=SMALLEST_SINGULAR_VALUE)[0]


def _execute(
    environment: Environment, networks: Sequence[CouplingModel], iteration: int, kind: str
) -> list[Rollout]:
    """Executions; conditions of the runs are the same in all iterations, which makes iterations paired."""
    place = (FEEDBACK, SAMPLE, IMPROVED).index(kind)
    which = 0 if kind == FEEDBACK else iteration
    return environment.rollouts(networks, [(which, place, number) for number in range(len(networks))])
