"""Choices made on tuning people: the same number of trials for every method, ours too.

A trial draws each parameter of a method from its options (`params.yaml`, `rival_trials`), is trained with
`count` demonstrations per tilt, and executed at `settings_deg` on every tuning person. That with the lowest
geometric mean of cost over people and tilts is chosen, and stands in `rival_methods`.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.rivals.imitation_data import Recorded, first
from dissertation.rivals.protocol import MODELS, MethodParameters, Trial, planned_runs, results_of
from dissertation.scraping.protocol.executions import Bench
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters

Options = dict[str, list[Any] | dict[str, list[Any]]]
"""Values to draw from, by parameter."""


class DrawingParameters(Parameters):
    """Trials whose parameters are drawn from options."""

    methods: ClassVar[type[Parameters]]  # that the options are of

    trials: int = Field(ge=1, le=100)
    seed: int = Field(ge=0)
    count: int = Field(ge=1)
    ours: Options
    feedforward: Options
    chunking: Options


class TrialParameters(DrawingParameters):
    """Trials on the board. Fields: `params.yaml`, `rival_trials`."""

    methods: ClassVar[type[Parameters]] = MethodParameters

    settings_deg: tuple[float, ...] = Field(min_length=1)
    runs: int = Field(ge=1)


def choose(
    person: int, bench: Bench, recorded: Recorded, parameters: TrialParameters, seed: int
) -> pd.DataFrame:
    """Results of all trials on one person, whose numbers are their level. `seed`: of training."""
    own, shown = parameters, first(recorded, parameters.count)
    plan = planned_runs(own.settings_deg, own.runs)
    trials = [
        Trial(model, number, its, shown, plan)
        for model in MODELS[1:]
        for number, its in enumerate(drawn_methods(model, own))
    ]
    return results_of(person, bench, trials, seed)


def drawn_methods(model: str, parameters: DrawingParameters) -> list[Any]:
    """Parameters of all trials of a method, no two alike.

    Raises InputError: there are too few options; ValidationError: one of them is out of range.
    """
    rng = np.random.default_rng([parameters.seed, MODELS.index(model)])
    kind: Any = parameters.methods.model_fields[model].annotation
    found: list[Any] = []
    for _ in range(100 * parameters.trials):
        drawn = kind.model_validate(_drawn(getattr(parameters, model), rng))
        found += [] if drawn in found else [drawn]
        if len(found) == parameters.trials:
            return found
    raise InputError(f"trials of {model}: the options do not make {parameters.trials} different trials")


def _drawn(options: Mapping[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    return {
        key: _drawn(its, rng) if isinstance(its, Mapping) else its[rng.integers(len(its))]
        for key, its in options.items()
    }


def trial_costs(results: pd.DataFrame, model: str) -> pd.Series:
    """Geometric mean of cost over people and tilts in rad, by trial; the lowest is chosen."""
    rows = results[(results["quantity"] == "cost") & (results["model"] == model)]
    return np.exp(np.log(rows.set_index("level")["value"]).groupby(level=0).mean())
