"""Reaches past spheres: as one person demonstrates them, and as rivals see and make them.

The demonstrations are those of the obstacle testbed, free reaches and reaches past a sphere at 40 places; all
methods get the same. Everything is in the local frame of the free reach. Rivals see, at 100 Hz,

    pose     position relative to the goal in m
    task     start minus goal in m, and the share of the duration that has passed
    sphere   its centre and its closest point relative to the hand in m

and predict later poses; the goal and the duration are given to them, as to the primitive. There is no robot:
a hand is where its method puts it, as in the unrolls of the dissertation (IV.8.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from dissertation.obstacles.protocol.avoidance_protocols import Situations, trained_scenarios
from dissertation.obstacles.world.reaching_person import AvoiderParameters, demonstrations
from dissertation.obstacles.world.scenarios import Scenario, SceneParameters, scenarios
from dissertation.rivals.imitation_data import Episode
from dissertation.rivals.policies import Ensemble, Policy
from dissertation.rivals.policy_execution import bounded
from dissertation.simulation.individuals import drawn
from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    AvoidanceDataset,
    avoidance_dataset,
    baseline_axes,
    fit_baseline,
    smooth_path,
    to_local,
)
from structlearn.avoidance.shapes import CloudBatch, Shape
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.vector import sample_count
from structlearn.readers.demonstration import Demonstration

SPHERE: Shape = "sphere"


@dataclass(frozen=True)
class Reaches:
    """Demonstrations of one person past spheres."""

    person: int  # seed
    baseline: PositionPrimitive  # of the free reach
    places: Sequence[Scenario]
    sets: Sequence[Sequence[Demonstration]]  # by place

    def first(self, count: int) -> "Reaches":
        """With the first demonstrations at every place."""
        return replace(self, sets=[its[:count] for its in self.sets])


def demonstrated(
    scene: SceneParameters, people: AvoiderParameters, parameters: AvoidanceDataParameters
) -> Reaches:
    """Demonstrations of the person with the seed of `people`, at the places of a scene."""
    person, places = drawn(people, people.seed), scenarios(scene, [SPHERE])
    free, *sets = [demonstrations(place, scene, person) for place in (None, *places)]
    return Reaches(people.seed, fit_baseline(free, parameters), places, sets)


def past_places(
    places: Sequence[Scenario], reaches: Reaches, parameters: AvoidanceDataParameters
) -> Situations:
    """Reaches of the baseline past spheres at some places."""
    return trained_scenarios(places, SPHERE, reaches.baseline, parameters.cloud_count)


def coupling_samples(reaches: Reaches, parameters: AvoidanceDataParameters) -> AvoidanceDataset:
    """What avoidance is learned from."""
    obstacles = [place.obstacle for place in reaches.places]
    return avoidance_dataset(zip(obstacles, reaches.sets, strict=True), reaches.baseline, parameters)


def reach_episodes(reaches: Reaches, parameters: AvoidanceDataParameters) -> list[Episode]:
    """What rivals learn from: the same paths, smoothed alike, each relative to its own end."""
    baseline, found = reaches.baseline, list[Episode]()
    (spheres,) = past_places(reaches.places, reaches, parameters).obstacles
    for number, its in enumerate(reaches.sets):
        for one in its:
            path = smooth_path(one, parameters).shifted(-baseline.start).turned(baseline_axes(baseline))
            pose, share = path.position - path.position[-1], path.time / path.time[-1]
            sphere = seen_sphere(path.position, spheres.centre[number], spheres.radius[number])
            found.append(Episode(number, pose, reach_task(pose[0], share), sphere))
    return found


def reach_task(start: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Task observations (B, 4) from a start relative to the goal, (3,) m, and shares of the duration (B,)."""
    return np.column_stack([np.tile(start, (len(share), 1)), share])


def seen_sphere(position: np.ndarray, centre: np.ndarray, radius: np.ndarray | float) -> np.ndarray:
    """Centre and closest point (B, 6) m of spheres relative to a hand at positions (B, 3) m.

    `centre` (B, 3) or (3,) m; `radius` (B,) or a number, m.
    """
    away = centre - position
    distance = np.linalg.norm(away, axis=1)
    closest = away * (1.0 - radius / np.maximum(distance, 1e-9))[:, None]
    return np.concatenate([away, closest], axis=1)


def executed_reaches(
    policy: Policy, baseline: PositionPrimitive, spheres: CloudBatch, dt: float
) -> np.ndarray:
    """Positions (B, T, 3) m of a rival's reaches past B spheres over the baseline's duration, every `dt` s.

    It decides every some samples; until the next decision the hand follows a cubic from its position and
    velocity to those decided, no faster than `Policy.fastest`. NaN from where the rival puts out none.
    """
    goal, every = to_local(baseline.goal, baseline), policy.parameters.every
    count, seconds, ensemble = sample_count(baseline.duration, dt), every * dt, Ensemble()
    pose = np.tile(-goal, (len(spheres.centre), 1))
    path, velocity = np.repeat(pose[:, None], count, axis=1), np.zeros_like(pose)
    most = every * np.array(policy.fastest)
    for sample in range(0, count - 1, every):
        task = reach_task(-goal, np.full(len(pose), sample / (count - 1)))
        sphere = seen_sphere(pose + goal, spheres.centre, spheres.radius)
        step = bounded(ensemble.update(policy.chunk(pose, task, sphere)) - pose, most)
        if not np.isfinite(step).all():
            path[:, sample + 1 :] = np.nan
            break
        way = CubicHermiteSpline([0.0, seconds], [pose, pose + step], [velocity, step / seconds])
        samples = np.arange(sample + 1, min(sample + 1 + every, count))
        path[:, samples] = np.swapaxes(way(dt * (samples - sample)), 0, 1)
        pose, velocity = pose + step, step / seconds
    return goal + path
