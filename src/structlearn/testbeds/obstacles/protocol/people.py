"""Demonstrations of each person of the testbed, as baseline, samples and scores.

Runs of one person are stored, to be shown; those of the others are simulated when needed.
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
    """Baseline, samples (`avoidance_dataset.to_table`) and `demonstration_scores` of one person.

    `recorded`: folder with the runs of `person`; other seeds are simulated. Tables have a column `person`.
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
    """Columns of `avoidance_scores.scores` for the demonstrations, with the goal distance at the last sample.

    By `obstacle`, `scenario` (number of the setting) and `demonstration` (from 1).
    """
    goal, rows = to_local(baseline.goal, baseline), []
    for scenario, its in zip(scenarios, sets, strict=True):
        cloud = cloud_batch(to_local(scenario.obstacle.cloud(cloud_count), baseline)[None])
        for number, one in enumerate(its, start=1):
            position = to_local(one.position, baseline)
            (distance,), (clearance,) = closest_approaches(one.time, position[None], [cloud])
            left = np.linalg.norm(position[-1] - goal)
            keys = (scenario.shape, scenario.setting, number)
            rows.append((*keys, distance, distance <= 0.0, clearance, left))
    columns = ["obstacle", "scenario", "demonstration", "obstacle_distance", "hit", "clearance_m"]
    return pd.DataFrame(rows, columns=[*columns, "goal_distance_m"])
