"""The people of the testbed: what each of them demonstrates, and what is learned from it.

Runs of one of them are kept, to be shown. The others are simulated where they are needed: as many runs of
each would say nothing more.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    fit_baseline,
    to_local,
    to_table,
)
from structlearn.avoidance.shapes import CLOUD_COUNT, cloud_batch
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration, read_runs
from structlearn.testbeds.obstacles.files import BASELINE
from structlearn.testbeds.obstacles.protocol.avoidance_scores import closest_approaches
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, demonstrations
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters, scenarios


def taught(
    seed: int,
    recorded: str | Path,
    scene: SceneParameters,
    person: AvoiderParameters,
    parameters: AvoidanceDataParameters,
) -> tuple[PositionPrimitive, pd.DataFrame, pd.DataFrame]:
    """What one person teaches.

    `recorded`: folder with the runs of `person`; others are simulated and differ by their seed. Returns the
    unhindered reach; the samples, see `avoidance_dataset.to_table`; and `demonstration_scores`; the tables
    with a column `person`.
    """
    places = scenarios(scene)
    if seed == person.seed:
        names = [BASELINE, *(place.name for place in places)]
        unhindered, *sets = [read_runs(Path(recorded, f"{name}.parquet")) for name in names]
    else:
        other = person.model_copy(update={"seed": seed})
        unhindered, *sets = [demonstrations(place, scene, other) for place in [None, *places]]
    baseline = fit_baseline(unhindered, parameters)
    pairs = zip((place.obstacle for place in places), sets, strict=True)
    samples = to_table(avoidance_dataset(pairs, baseline, parameters))
    scores = demonstration_scores(sets, places, baseline, parameters.cloud_count)
    return baseline, samples.assign(person=seed), scores.assign(person=seed)


def demonstration_scores(
    sets: Sequence[Sequence[Demonstration]],
    scenarios: Sequence[Scenario],
    baseline: PositionPrimitive,
    cloud_count: int = CLOUD_COUNT,
) -> pd.DataFrame:
    """How the demonstrations themselves avoid their obstacles and reach the baseline's goal.

    Returns `obstacle_distance`, `hit`, `clearance_m` (see `avoidance_scores.scores`) and, at the last sample,
    `goal_distance_m` per `obstacle`, `scenario` (number of the setting) and `demonstration` (from 1).
    """
    goal, rows = to_local(baseline.goal, baseline), []
    for scenario, its in zip(scenarios, sets, strict=True):
        cloud = cloud_batch(to_local(scenario.obstacle.cloud(cloud_count), baseline)[None])
        for number, one in enumerate(its, start=1):
            position = to_local(one.position, baseline)
            (distance,), (clearance,) = closest_approaches(one.time, position[None], [cloud])
            left = np.linalg.norm(position[-1] - goal)
            its_keys = (scenario.shape, scenario.setting, number)
            rows.append((*its_keys, distance, distance <= 0.0, clearance, left))
    keys = ["obstacle", "scenario", "demonstration"]
    return pd.DataFrame(rows, columns=[*keys, "obstacle_distance", "hit", "clearance_m", "goal_distance_m"])
