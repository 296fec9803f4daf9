"""Scores of obstacle avoidance and goal reaching: the columns of tables IV.1 to IV.3.

The tables' distance to an obstacle is unitless, (|x - centre| - r) / r with the virtual radius r; a movement
hits if it is 0 or less. This is exact for spheres only, so the distance in m to the closest point of the
cloud is given as well. Demonstrations are scored alike: one person's recorded runs, and simulated runs of the
others.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.obstacles.files import BASELINE
from dissertation.obstacles.world.reaching_person import AvoiderParameters, demonstrations
from dissertation.obstacles.world.scenarios import Scenario, SceneParameters, scenarios
from dissertation.simulation.individuals import drawn
from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    avoidance_table,
    fit_baseline,
    to_local,
)
from structlearn.avoidance.avoiding_unroll import AvoidancePaths
from structlearn.avoidance.features import closest_distance
from structlearn.avoidance.shapes import CLOUD_COUNT, CloudBatch, cloud_batch
from structlearn.core.errors import InputError
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.vector import sample_count
from structlearn.readers.demonstration import Demonstration, read_runs

ONSET_SPEED = 0.05  # share of the peak speed at which a reach begins and ends, usual in studies of reaching
LATE_FACTOR = 1.5  # durations at which the goal distance is scored again, when the forcing term has vanished


def unitless_distance(position: np.ndarray, centre: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
    """Distance (...) of positions (..., 3) from a virtual surface in virtual radii; 0 or less is a hit."""
    return (np.linalg.norm(np.subtract(position, centre), axis=-1) - radius) / radius


def closest_approaches(
    time: np.ndarray, position: np.ndarray, obstacles: Sequence[CloudBatch]
) -> tuple[np.ndarray, np.ndarray]:
    """Closest approach of movements (B, T, 3) m to any of their obstacles, at times (T,) s.

    Returns `unitless_distance` (B,), and the distance (B,) in m to the closest cloud point.
    """
    unitless, clearance = [], []
    for obstacle in obstacles:
        seen = position - obstacle.path(time)  # relative to the obstacle's initial place
        distances = unitless_distance(seen, obstacle.centre[:, None], obstacle.radius[:, None])
        unitless.append(distances.min(axis=1))
        clearance.append(closest_distance(seen, obstacle.points[:, None]).min(axis=1))
    return np.min(unitless, axis=0), np.min(clearance, axis=0)


def unroll_scores(paths: AvoidancePaths, obstacles: Sequence[CloudBatch], bare: np.ndarray) -> pd.DataFrame:
    """Scores of a batch of unrolls, one row per scenario.

    Over the prescribed duration: `obstacle_distance` (closest, unitless), `hit`, `clearance_m` (closest to
    the cloud), `detour_m` (largest distance from the path without avoidance, `bare` (B, T, 3) m), and
    `restrained`, the share of samples whose coupling term was limited for the goal. `goal_distance_m` at its
    end, `late_goal_distance_m` at `LATE_FACTOR` durations, `excursion_m`: the largest from its end on.

    Raises InputError: unrolls are shorter than `LATE_FACTOR` durations.
    """
    dt = paths.path.dt
    end, late = (sample_count(factor * paths.duration, dt) for factor in (1.0, LATE_FACTOR))
    if late > len(paths.path.time):
        raise InputError(
            f"unrolls of {paths.path.duration:g} s are too short to score: the goal is looked at "
            f"{LATE_FACTOR:g} durations of {paths.duration:g} s after the start"
        )
    position = paths.path.position
    distance, clearance = closest_approaches(paths.path.time[:end], position[:, :end], obstacles)
    to_goal = np.linalg.norm(position - paths.goal[:, None], axis=-1)
    return pd.DataFrame(
        {
            "obstacle_distance": distance,
            "hit": distance <= 0.0,
            "clearance_m": clearance,
            "detour_m": np.linalg.norm(position - bare, axis=-1)[:, :end].max(axis=1),
            "goal_distance_m": to_goal[:, end - 1],
            "excursion_m": to_goal[:, end - 1 :].max(axis=1),
            "late_goal_distance_m": to_goal[:, late - 1],
            "restrained": (paths.requested != paths.coupling)[:, :end].any(axis=-1).mean(axis=1),
        }
    )


def person_data(
    seed: int,
    recorded: str | Path,
    scene: SceneParameters,
    people: AvoiderParameters,
    parameters: AvoidanceDataParameters,
) -> tuple[PositionPrimitive, pd.DataFrame, pd.DataFrame]:
    """Baseline, samples (`avoidance_dataset.avoidance_table`) and `demonstration_scores` of one person.

    `recorded` is the folder with the runs of the person with the seed of `people`; others are simulated.
    Tables have a column `person`; scores also `near`, whether the obstacle is near the line of the reach, and
    the person's `preference_m`.
    """
    places, person = scenarios(scene), drawn(people, seed)
    if seed == people.seed:
        names = [BASELINE, *(place.name for place in places)]
        unhindered, *sets = [read_runs(Path(recorded, f"{name}.parquet")) for name in names]
    else:
        unhindered, *sets = [demonstrations(place, scene, person) for place in [None, *places]]
    baseline = fit_baseline(unhindered, parameters)
    pairs = zip((place.obstacle for place in places), sets, strict=True)
    samples = avoidance_table(avoidance_dataset(pairs, baseline, parameters))
    scored = demonstration_scores(sets, places, baseline, parameters.cloud_count)
    scored = scored.assign(
        near=scored["scenario"] <= scene.near_settings, person=seed, preference_m=person.preference_m
    )
    return baseline, samples.assign(person=seed), scored


def demonstration_scores(
    sets: Sequence[Sequence[Demonstration]],
    scenarios: Sequence[Scenario],
    baseline: PositionPrimitive,
    cloud_count: int = CLOUD_COUNT,
) -> pd.DataFrame:
    """Scores of demonstrations, with columns as in `unroll_scores`; the goal distance is at the last sample.

    `movement_s` is the `movement_time`. Rows are identified by `obstacle`, `scenario` (number of the setting)
    and `demonstration` (from 1).
    """
    goal, rows = to_local(baseline.goal, baseline), []
    for scenario, its in zip(scenarios, sets, strict=True):
        cloud = cloud_batch(to_local(scenario.obstacle.cloud(cloud_count), baseline)[None])
        for number, one in enumerate(its, start=1):
            position = to_local(one.position, baseline)
            (distance,), (clearance,) = closest_approaches(one.time, position[None], [cloud])
            left = np.linalg.norm(position[-1] - goal)
            keys = (scenario.shape, scenario.setting, number)
            rows.append((*keys, distance, distance <= 0.0, clearance, left, movement_time(one)))
    columns = ["obstacle", "scenario", "demonstration", "obstacle_distance", "hit", "clearance_m"]
    return pd.DataFrame(rows, columns=[*columns, "goal_distance_m", "movement_s"])


def movement_time(demonstration: Demonstration) -> float:
    """Time in s from the first to the last sample whose speed is at least `ONSET_SPEED` of the largest."""
    velocity = np.gradient(demonstration.position, demonstration.time, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    moving = demonstration.time[speed >= ONSET_SPEED * speed.max()]
    return float(moving[-1] - moving[0])
