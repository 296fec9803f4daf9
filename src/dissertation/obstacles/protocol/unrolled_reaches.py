"""Unrolls of an evaluation as single reaches, for figures and recordings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from dissertation.obstacles.protocol.avoidance_protocols import LIMITED, NO_MODEL, Situations
from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.primitives.position import PositionPrimitive

KEYS = ["protocol", "obstacle", "scenario", "speed_m_s", "model", "learned_from"]
"""Columns that identify an unroll of one person."""

NUMBERS = ["time_s", "x_m", "y_m", "z_m", "coupling_x", "coupling_y", "coupling_z"]
"""Path columns: time, position, coupling term."""


class SituationKey(NamedTuple):
    """Identifies a situation of an evaluation, see `avoidance_protocols.Situations.keys`."""

    protocol: str
    obstacle: str
    number: int
    speed_m_s: float = 0.0


@dataclass(frozen=True)
class Reach:
    """One unroll in one situation."""

    model: str  # kind, or `NO_MODEL`
    learned_from: str  # see `learned_models.AvoidanceModels`
    time: np.ndarray  # (T,) s since the start
    position: np.ndarray  # (T, 3) m, base frame
    coupling: np.ndarray  # (T, 3) m, applied coupling term, local frame of the reach
    coupling_in_base: np.ndarray  # (T, 3) the same in the base frame
    obstacle_distance: float  # closest approach to the virtual surface, in virtual radii
    hit: bool  # whether the distance is 0 or less
    goal_distance_m: float  # at the prescribed time


Group = Sequence[Reach]
"""Reaches of all models in one situation, in the order of evaluation."""


def reaches_by_situation(
    paths: pd.DataFrame, scores: pd.DataFrame, baseline: PositionPrimitive
) -> dict[SituationKey, list[Reach]]:
    """One person's unrolls with limits at the goal (`avoidance_protocols.evaluate_avoidance`), by situation.

    The order is that of the evaluation, so the first reach of each group is without avoidance.
    """
    limited = scores[scores["rules"] == LIMITED].set_index(KEYS)
    scored = limited[["obstacle_distance", "hit", "goal_distance_m"]].to_dict("index")
    axes = baseline_axes(baseline)
    numbers = paths[NUMBERS].to_numpy(float).T
    rows = pd.Series(range(len(paths)), paths.index).groupby([paths[key] for key in KEYS], sort=False)
    reaches: dict[SituationKey, list[Reach]] = {}
    for key, places in rows:  # thousands of groups: building a frame for each would be slow
        time, position, coupling = np.split(numbers.take(places, axis=1), [1, 4])
        time, position, coupling = time[0], position.T, coupling.T
        *situation, model, learned_from = key
        reach = Reach(model, learned_from, time, position, coupling, coupling @ axes.T, **scored[key])
        reaches.setdefault(SituationKey(*situation), []).append(reach)
    return reaches


def groups_of(situation: Situations, reaches: Mapping[SituationKey, Group]) -> list[Group]:
    """Reaches of each situation of a batch, in order."""
    return [
        reaches[SituationKey(situation.protocol, situation.obstacle, int(number), float(speed))]
        for number, speed in zip(situation.numbers, situation.speed, strict=True)
    ]


def of_model(reaches: Group, model: str) -> list[Reach]:
    """The reaches of one model."""
    return [reach for reach in reaches if reach.model == model]


def without_avoidance(reaches: Group) -> Reach:
    """The reach without coupling term."""
    return of_model(reaches, NO_MODEL)[0]


def hit_settings(reaches: Mapping[SituationKey, Group], protocol: str) -> set[tuple[str, int]]:
    """Obstacle and number of a protocol's situations in which the reach without avoidance hits."""
    return {
        (key.obstacle, key.number)
        for key, group in reaches.items()
        if key.protocol == protocol and without_avoidance(group).hit
    }
