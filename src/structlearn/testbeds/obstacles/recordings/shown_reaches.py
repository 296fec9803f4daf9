"""Which reaches past obstacles the recordings show, from the files of the obstacle stages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, PHASE_MODULATED, SETTING
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import LIMITED, NO_MODEL
from structlearn.testbeds.obstacles.world.scenarios import Scenario

MODEL_NAMES = {NETWORK: "network", HUMAN_INSPIRED: "human-inspired", PHASE_MODULATED: "phase-modulated"}
"""Of the models, for headings."""


class ObstacleViewParameters(Parameters):
    """What the recordings of demonstrations and of models show.

    Attributes:
        scenarios: names, `shape/setting`; each has a tab.
    """

    scenarios: tuple[str, ...] = Field(
        default=("sphere/04", "cube/04", "cylinder/04", "sphere/13", "cube/13", "cylinder/13"), min_length=1
    )


class SituationKey(NamedTuple):
    """Which reach of an evaluation: the columns of `protocols.situation_keys`."""

    protocol: str
    obstacle: str
    number: int
    speed_m_s: float = 0.0


@dataclass(frozen=True)
class Reach:
    """One unroll in one situation.

    Attributes:
        model: whose coupling term acted, or `protocols.NO_MODEL`.
        learned_from: what it learned from, see `learned_models.AvoidanceModels`.
        time: (T,) s since the start.
        position: (T, 3) m, base frame.
        coupling: (T, 3) m, coupling term that acted, local frame of the reach.
        coupling_in_base: (T, 3) the same in the base frame.
        obstacle_distance: of the closest approach, in virtual radii from the virtual surface.
        hit: whether that is not positive.
        goal_distance_m: at the prescribed time.
    """

    model: str
    learned_from: str
    time: np.ndarray
    position: np.ndarray
    coupling: np.ndarray
    coupling_in_base: np.ndarray
    obstacle_distance: float
    hit: bool
    goal_distance_m: float

    @property
    def label(self) -> str:
        """Its origin among reaches of the same model."""
        return {"": "baseline", SETTING: "this scenario", ALL: "all shapes"}.get(
            self.learned_from, f"all {self.learned_from}s"
        )


@dataclass(frozen=True)
class ShownScenario:
    """A scenario, how people avoided its obstacle, and how the models do.

    Attributes:
        scenario: with its obstacle in the base frame.
        cloud: (P, 3) m, base frame, the points of the obstacle that models see.
        demonstrations: of people.
        targets: of what the demonstrations teach, columns `demonstration`, `time_s`, `target_x` ...
        reaches: of the models; that of the baseline is among them.
    """

    scenario: Scenario
    cloud: np.ndarray
    demonstrations: Sequence[Demonstration]
    targets: pd.DataFrame
    reaches: Sequence[Reach]


def chosen_scenarios(places: Sequence[Scenario], names: Sequence[str]) -> dict[int, Scenario]:
    """Scenarios by their number in the dataset, in the order of the names.

    Raises:
        InputError: there is no scenario of a name.
    """
    known = {place.name: number for number, place in enumerate(places)}
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(
            f"inspect_obstacles.scenarios: there is no '{missing[0]}'; names are '{places[0].name}' to "
            f"'{places[-1].name}'"
        )
    return {known[name]: places[known[name]] for name in names}


def reaches_by_situation(
    paths: pd.DataFrame, scores: pd.DataFrame, baseline: PositionPrimitive
) -> dict[SituationKey, list[Reach]]:
    """The unrolls of an evaluation.

    Args:
        paths: of `protocols.evaluate`.
        scores: of `protocols.evaluate`, those of the same post-processing are taken.
        baseline: whose local frame the coupling terms are in.

    Returns:
        By situation the reaches of all models, in the order in which they were evaluated: the baseline first.
    """
    keys = ["protocol", "obstacle", "scenario", "speed_m_s", "model", "learned_from"]
    of_limited = scores[scores["rules"] == LIMITED].set_index(keys)
    columns = ["obstacle_distance", "hit", "goal_distance_m"]
    found = {key: row for key, *row in of_limited[columns].itertuples(name=None)}
    axes = baseline_axes(baseline)
    reaches: dict[SituationKey, list[Reach]] = {}
    for key, rows in paths.groupby(keys, sort=False):
        coupling = rows[["coupling_x", "coupling_y", "coupling_z"]].to_numpy(float)
        distance, hit, goal_distance = found[key]
        reach = Reach(
            model=key[4],
            learned_from=key[5],
            time=rows["time_s"].to_numpy(float),
            position=rows[["x_m", "y_m", "z_m"]].to_numpy(float),
            coupling=coupling,
            coupling_in_base=coupling @ axes.T,
            obstacle_distance=float(distance),
            hit=bool(hit),
            goal_distance_m=float(goal_distance),
        )
        reaches.setdefault(SituationKey(*key[:4]), []).append(reach)
    return reaches


def of_model(reaches: Sequence[Reach], model: str) -> list[Reach]:
    """The reaches of one model, without the baseline's."""
    return [reach for reach in reaches if reach.model == model]


def of_baseline(reaches: Sequence[Reach]) -> Reach:
    """The reach without coupling term."""
    return next(reach for reach in reaches if reach.model == NO_MODEL)


def hit_settings(reaches: Mapping[SituationKey, Sequence[Reach]], protocol: str) -> set[tuple[str, int]]:
    """Obstacle and number of the situations of a protocol in which the baseline hits."""
    return {
        (key.obstacle, key.number)
        for key, group in reaches.items()
        if key.protocol == protocol and of_baseline(group).hit
    }
