"""Which scenarios of the testbed the recordings show, with all that there is of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import TRAINED
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import Group, SituationKey
from structlearn.testbeds.obstacles.world.scenarios import Scenario


class ObstacleViewParameters(Parameters):
    """What the recordings of demonstrations and of models show."""

    scenarios: tuple[str, ...] = Field(min_length=1)


@dataclass(frozen=True)
class ShownScenario:
    """A scenario, how people avoided its obstacle, and how the models do."""

    scenario: Scenario  # with its obstacle in the base frame
    cloud: np.ndarray  # (P, 3) m, base frame, the points of the obstacle that models see
    demonstrations: Sequence[Demonstration]  # of people
    targets: pd.DataFrame  # of what the demonstrations teach, columns `demonstration`, `time_s`, `target_x`
    reaches: Group  # of the models; that without avoidance is among them


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


def shown_scenarios(
    chosen: Mapping[int, Scenario],
    demonstrations: Sequence[Sequence[Demonstration]],
    samples: pd.DataFrame,
    reaches: Mapping[SituationKey, Group],
    cloud_count: int,
) -> list[ShownScenario]:
    """All that there is of the chosen scenarios.

    `chosen`: of `chosen_scenarios`; `reaches`: of `unrolled_reaches.reaches_by_situation`.
    """
    return [
        ShownScenario(
            scenario,
            scenario.obstacle.cloud(cloud_count),
            people,
            samples[samples["scenario"] == number],
            reaches[SituationKey(TRAINED, scenario.shape, scenario.setting)],
        )
        for (number, scenario), people in zip(chosen.items(), demonstrations, strict=True)
    ]
