"""Results of the testbed in one long table, see `evidence.results`.

Reaches are summed up by person, situation, rules, model and shape of the obstacle. Those of people are the
model `DEMONSTRATED`: of all scenarios and, learned from `SETTING`, of those for which the person has models
per setting. `nmse` is of a model's coupling terms: along an axis, `all` three, `across` the reach (mean of y
and z), and along the `dominant` axis of scenarios that have one. `log_clearance_m` and `log_movement_s` are
of people past obstacles near the line of the reach, as sums for `variance_shares`.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from dissertation.evidence.results import joined_results, long_table
from dissertation.evidence.variance_shares import trial_sums
from dissertation.obstacles.protocol.avoidance_protocols import TRAINED
from structlearn.avoidance.learned_models import SETTING

KEYS = {
    "person": int,  # seed
    "protocol": str,  # of `avoidance_protocols`
    "rules": str,  # `PUBLISHED` or `LIMITED`
    "model": str,  # kind of model, `NO_MODEL` or `DEMONSTRATED`
    "learned_from": str,  # see `learned_models.AvoidanceModels`
    "obstacle": str,  # shape
    "setting": float,  # number from 1 of models trained on one scenario
    "part": str,  # `train` or `test`: samples that errors are of
    "axis": str,
}

DEMONSTRATED = "demonstrations"
WHO, REPEATED = "person", ["obstacle", "scenario"]  # columns of demonstrations: a person repeats scenarios

SUMMARIES = {
    "reaches": ("hit", "size", ""),
    "hits": ("hit", "sum", ""),
    "largest_goal_distance": ("goal_distance_m", "max", "m"),
    "mean_goal_distance": ("goal_distance_m", "mean", "m"),
    "largest_late_goal_distance": ("late_goal_distance_m", "max", "m"),
    "largest_excursion": ("excursion_m", "max", "m"),
    "mean_detour": ("detour_m", "mean", "m"),
    "restrained": ("restrained", "mean", ""),
    "closest": ("obstacle_distance", "min", "radii"),
    "mean_distance": ("obstacle_distance", "mean", "radii"),
    "least_clearance": ("clearance_m", "min", "m"),
}
"""Column of `avoidance_scores.scores`, how it is reduced over reaches, and unit, by quantity."""

AXES = ("x", "y", "z", "across", "all", "dominant")


def obstacle_results(scores: pd.DataFrame, demonstrated: pd.DataFrame, errors: pd.DataFrame) -> pd.DataFrame:
    """Table of results.

    `scores`: of `avoidance_protocols.evaluate`; `demonstrated`: of `avoidance_scores.demonstration_scores` by
    person; `errors`: of `avoidance_fits.learn`.
    """
    own = scores.loc[scores["learned_from"] == SETTING, ["person", "obstacle", "scenario"]].drop_duplicates()
    people = demonstrated.assign(learned_from=""), demonstrated.merge(own).assign(learned_from=SETTING)
    by = ["person", "protocol", "rules", "model", "learned_from", "obstacle"]
    parts = [
        *_reaches("obstacles_evaluate", scores, by),
        *_reaches(
            "obstacles_dataset",
            pd.concat(people),
            ["person", "learned_from", "obstacle"],
            protocol=TRAINED,
            model=DEMONSTRATED,
        ),
        fits(errors),
        *people_rows(demonstrated),
    ]
    return joined_results(parts, KEYS)


def _reaches(stage: str, scores: pd.DataFrame, by: Sequence[str], **keys: str) -> Iterator[pd.DataFrame]:
    groups = scores.groupby(list(by), sort=False)
    for quantity, (column, how, unit) in SUMMARIES.items():
        if column in scores:
            yield long_table(stage, quantity, groups[column].agg(how), unit, **keys)


def people_rows(demonstrated: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Rows of people's behaviour and constants."""
    preference = demonstrated.groupby("person", sort=False)["preference_m"].first()
    yield long_table("obstacles_dataset", "preference", preference, "m")
    near = demonstrated[demonstrated["near"]]
    logs = np.log(near[["clearance_m", "movement_s"]]).add_prefix("log_").join(near[[WHO, *REPEATED]])
    for quantity in ("log_clearance_m", "log_movement_s"):
        yield from trial_sums("obstacles_dataset", quantity, logs, WHO, REPEATED)


def fits(errors: pd.DataFrame) -> pd.DataFrame:
    """Rows of errors of models."""
    table = errors.assign(
        nmse_all=errors["nmse"],
        nmse_across=errors[["nmse_y", "nmse_z"]].mean(axis=1),
        setting=errors["scenario"].where(errors["scenario"] > 0),
    )
    by = ["person", "model", "learned_from", "obstacle", "setting", "part"]
    tall = table.melt(by, [f"nmse_{axis}" for axis in AXES], "axis").dropna(subset="value")
    tall["axis"] = tall["axis"].str.removeprefix("nmse_")
    return long_table("obstacles_train", "nmse", tall.set_index([*by, "axis"])["value"])
