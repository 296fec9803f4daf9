"""Executions of one primitive for its refinement: what is asked of an environment, and what is kept.

Every rollout stays on record, the failed ones with their fault: a row in the history, and what was felt and
done sample by sample.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd

from structlearn.feedback.coupling_dataset import CouplingDataset, to_table
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.ground.errors import InputError
from structlearn.primitives import canonical
from structlearn.primitives.kernels import KERNEL_COUNT, features

FEEDBACK, SAMPLE, IMPROVED = "feedback", "sample", "improved"
"""Kinds of rollouts: with the network, with a drawn policy, with the updated policy."""


@dataclass(frozen=True)
class Rollout:
    """One execution of the primitive that is refined."""

    cost: np.ndarray  # (T,) rad per tick; NaN throughout where it failed
    # what was felt and done, as supervised data; None where it failed, or where the environment was not to
    # say
    samples: CouplingDataset | None
    fault: str = ""  # why it failed, or empty


class Environment(Protocol):
    """Where the primitive is executed; `seeds` decide what a run meets, and repeat it exactly."""

    @property
    def rate_hz(self) -> float:
        """Ticks per second of the costs."""

    def rollouts(self, networks: Sequence[CouplingModel], seeds: Sequence[tuple[int, ...]]) -> list[Rollout]:
        """Execute once per network, each with its seed, and report failures instead of raising them."""


def succeeded(runs: Sequence[Rollout], what: str, fewest: int = 1) -> list[Rollout]:
    """The runs that did not fail. Raises InputError: with the first fault, if there are too few."""
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
    """How much each weight of an open-loop policy acts at every tick of a primitive: |G_i(p, u)|.

    `steps`: ticks T from the primitive's start to its end. `kernel_count`: number of weights N. Returns
    (T, N).
    """
    p, u = canonical.phase(np.linspace(0.0, 1.0, steps), canonical.TAU_PER_DURATION)
    return np.abs(features(p, u, kernel_count))


def history_rows(runs: Sequence[Rollout], iteration: int, kind: str) -> pd.DataFrame:
    """One row per rollout, failed ones too.

    Returns `iteration`, `kind`, `number`, `cost_rad` (accumulated; NaN where it failed), `norm_rad`
    (of the cost vector), `fault`.
    """
    return pd.DataFrame(
        {
            "iteration": iteration,
            "kind": kind,
            "number": range(len(runs)),
            "cost_rad": [float(np.sum(run.cost)) for run in runs],
            "norm_rad": [float(np.linalg.norm(run.cost)) for run in runs],
            "fault": [run.fault for run in runs],
        }
    )


def sample_rows(runs: Sequence[Rollout], iteration: int, kind: str, rate_hz: float) -> pd.DataFrame:
    """What was felt and done in the rollouts that did not fail, of which there must be one.

    Returns one row per sample: `iteration`, `kind`, `number`, the columns of `dataset.to_table`, and
    `cost_rad` at this sample; in single precision, for they are looked at, not learned from.
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
