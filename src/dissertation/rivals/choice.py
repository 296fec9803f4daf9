"""Choices made on tuning people: the same number of trials for every method, ours too.

A trial draws each parameter of a method from its options (`params.yaml`, `rival_trials`), is trained with
`count` demonstrations per tilt, and executed at `settings_deg` on every tuning person. That with the lowest
geometric mean of cost over people and tilts is chosen, and stands in `rival_methods`.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.evidence.results import joined_results, long_table
from dissertation.rivals.imitation_data import UNMOVED, Recorded
from dissertation.rivals.protocol import (
    AS_DEMONSTRATED,
    MODELS,
    ComparisonParameters,
    MethodParameters,
    Planned,
    method_scores,
    run_at,
)
from dissertation.scraping.protocol.executions import Bench
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters

TRIED = 14  # first number of a run's seed, its purpose; see `protocol.EVALUATED`
STAGE = "rivals_choose"
KEYS: Mapping[str, type] = {"person": int, "model": str, "level": float, "setting": float}  # level: the trial

Options = dict[str, list[Any] | dict[str, list[Any]]]
"""Values to draw from, by parameter."""


class TrialParameters(Parameters):
    """Trials. Fields: `params.yaml`, `rival_trials`."""

    trials: int = Field(ge=1, le=100)
    seed: int = Field(ge=0)
    count: int = Field(ge=1)
    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1)
    ours: Options
    feedforward: Options
    recurrent: Options
    chunking: Options


def trials(model: str, parameters: TrialParameters) -> list[Any]:
    """Parameters of all trials of a method, no two alike.

    Raises InputError: there are too few options; ValidationError: one of them is out of range.
    """
    rng = np.random.default_rng([parameters.seed, MODELS.index(model)])
    kind = MethodParameters.model_fields[model].annotation
    assert kind is not None
    found: list[Any] = []
    for _ in range(100 * parameters.trials):
        drawn = kind.model_validate(_drawn(getattr(parameters, model), rng))
        found += [] if drawn in found else [drawn]
        if len(found) == parameters.trials:
            return found
    raise InputError(f"rival_trials.{model}: the options do not make {parameters.trials} different trials")


def _drawn(options: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    return {
        key: _drawn(its, rng) if isinstance(its, Mapping) else its[rng.integers(len(its))]
        for key, its in options.items()
    }


def tried(
    person: int,
    bench: Bench,
    recorded: Recorded,
    parameters: ComparisonParameters,
    choice: TrialParameters,
) -> pd.DataFrame:
    """Results of all trials on one person: `trial_cost`, and the share `trial_failed`."""
    plan = [
        Planned(run_at(TRIED, tilt, number), UNMOVED, AS_DEMONSTRATED)
        for tilt in choice.settings_deg
        for number in range(choice.runs)
    ]
    work = [(model, place, its) for model in MODELS[1:] for place, its in enumerate(trials(model, choice))]
    trial = partial(_tried, bench=bench, recorded=recorded.first(choice.count), plan=plan, own=parameters)
    parts = []
    for (model, place, _), scores in zip(work, parallel_map(trial, work, "trials"), strict=True):
        means = scores.groupby("setting")[["cost", "failed"]].mean()
        keys: dict[str, Any] = {"person": person, "model": model, "level": float(place)}
        parts.append(long_table(STAGE, "trial_cost", means["cost"], "rad", **keys))
        parts.append(long_table(STAGE, "trial_failed", means["failed"], **keys))
    return joined_results(parts, KEYS)


def _tried(
    work: tuple[str, int, Any],
    bench: Bench,
    recorded: Recorded,
    plan: Sequence[Planned],
    own: ComparisonParameters,
) -> pd.DataFrame:
    return method_scores(bench, recorded, work[2], plan, own.margin_m, own.seed)[0]


def trial_costs(results: pd.DataFrame, model: str) -> pd.Series:
    """Geometric mean of cost over people and tilts in rad, by trial; the lowest is chosen."""
    rows = results[(results["quantity"] == "trial_cost") & (results["model"] == model)]
    return np.exp(np.log(rows.set_index("level")["value"]).groupby(level=0).mean())
