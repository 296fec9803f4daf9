"""Obstacle placement: 40 settings for each of three shapes, and 63 unseen spheres (IV.8.3, IV.8.7).

The recorded settings are not public. These approximate what is known: a reach without avoidance hits the
obstacle in 4 of 120 scenarios, 43 of 120 have a dominant axis of avoidance, the closest distance is 5 radii
on average (table IV.1), and in the public samples obstacles lie up to 1.1 m along and 0.9 m beside the reach,
and up to 0.25 m higher or lower.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from structlearn.avoidance.shapes import HALF_SIZE_M, SHAPES, Obstacle, Shape, obstacle
from structlearn.core.errors import InputError
from structlearn.core.frames import frame_kind, local_frame
from structlearn.core.params import Parameters
from structlearn.primitives.position import SHORTEST_REACH

Metres = tuple[float, float, float]

NEAR_M = (0.15, 0.09)
"""Half axes, sideways and upwards, of the ellipse across the reach that holds the near obstacles. A hand
keeps about 0.12 m away, so nearly all require avoidance and a few are hit without it."""

FAR_ALONG = (-0.6, 1.6)  # range of far obstacles along the reach, relative to its length
FAR_M = (0.9, 0.2)  # half width and half height of the box that holds far obstacles
FAR_CLEARANCE_M = 0.25  # from the line of the reach to the centre of a far obstacle: no detour is needed

END_CLEARANCE_M = 0.06
"""Least distance from start or goal to an obstacle's surface, for the hand to fit; as for unseen spheres."""

GRID_ALONG = np.array([-1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0]) / 6.0
"""Seven points from start to goal as fractions, with both ends pushed outwards by one spacing."""

GRID_ACROSS_M, UNSEEN_RADIUS_M = np.array([-0.025, 0.0, 0.025]), 0.05


class SceneParameters(Parameters):
    """Reach and obstacle placement."""

    start_m: Metres
    goal_m: Metres
    settings: int = Field(ge=1, le=1000)
    near_share: float = Field(ge=0, le=1)
    seed: int = Field(ge=0)
    tuning_seed: int = Field(ge=0)

    @model_validator(mode="after")
    def _are_apart(self) -> Self:
        if self.seed == self.tuning_seed:
            raise ValueError(f"scene {self.seed} is the one that constants were chosen on")
        return self

    @property
    def start(self) -> np.ndarray:
        """(3,) m."""
        return np.array(self.start_m)

    @property
    def goal(self) -> np.ndarray:
        """(3,) m."""
        return np.array(self.goal_m)

    @property
    def near_settings(self) -> int:
        """Number of settings near the line of the reach; they come first."""
        return round(self.near_share * self.settings)


@dataclass(frozen=True)
class Scenario:
    """An obstacle in one of its settings."""

    setting: int  # number of the position, from 1
    obstacle: Obstacle  # in the base frame

    @property
    def shape(self) -> Shape:
        """Shape of the obstacle."""
        return self.obstacle.shape

    @property
    def name(self) -> str:
        """Scenario name, e.g. `sphere/07`; also the folder of its recordings."""
        return f"{self.shape}/{self.setting:02d}"


def scenarios(parameters: SceneParameters, shapes: Sequence[Shape] = SHAPES) -> list[Scenario]:
    """All settings with all shapes, ordered by shape; scenario indices follow this order.

    Raises InputError: start and goal are too close to each other.
    """
    centres, yaws = _positions(parameters)
    return [
        Scenario(number, obstacle(shape, centre, yaw))
        for shape in shapes
        for number, (centre, yaw) in enumerate(zip(centres, yaws, strict=True), start=1)
    ]


def own_scenarios(scenarios: Sequence[Scenario], people: Sequence[int]) -> dict[int, np.ndarray]:
    """Ascending indices of the scenarios for which each person has models per setting.

    Settings are assigned in turn, with all their shapes: training each for everybody would take too long.
    """
    turn = np.array([(scenario.setting - 1) % len(people) for scenario in scenarios])
    return {person: np.flatnonzero(turn == place) for place, person in enumerate(people)}


def reach_frame(start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) from a reach's local frame, as in its primitive, to base: x along the reach (IV.6.1).

    For a reach along gravity, no z axis is closest to up; then y is anchored instead (`frames.frame_kind`).
    Raises InputError: start and goal, (3,) m each, are too close to have a direction.
    """
    length = float(np.linalg.norm(np.subtract(goal, start)))
    if not length >= SHORTEST_REACH:
        raise InputError(f"a reach of {length:g} m has no direction; it needs at least {SHORTEST_REACH:g} m")
    return local_frame(start, goal, frame_kind(np.subtract(goal, start), SHORTEST_REACH))


def check_clear(solid: Obstacle, start: np.ndarray, goal: np.ndarray) -> None:
    """Raise InputError if an obstacle contains the start or the goal, which makes avoidance impossible."""
    for end, point in (("start", start), ("goal", goal)):
        if solid.signed_distance(point) <= 0.0:
            place = ", ".join(f"{value:g}" for value in solid.centre)
            raise InputError(f"the {solid.shape} at ({place}) m contains the {end} of the reach")


def unseen_centres(start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Centres (63, 3) m of the unseen spheres: a 7 x 3 x 3 grid around the reach, z fastest (IV.8.7).

    The author's grid is aligned with world axes, along which his reach ran; ours is aligned with the reach.
    Raises InputError: as `reach_frame`.
    """
    axes = reach_frame(start, goal)
    length = np.linalg.norm(np.subtract(goal, start))
    grid = np.meshgrid(length * GRID_ALONG, GRID_ACROSS_M, GRID_ACROSS_M, indexing="ij")
    return start + np.stack(grid, axis=-1).reshape(-1, 3) @ axes.T


def _positions(parameters: SceneParameters) -> tuple[np.ndarray, np.ndarray]:
    """Centres (settings, 3) m in the base frame, and yaw angles (settings,) rad.

    Positions are drawn until all shapes leave start and goal free. Near ones are spread evenly along the
    reach.
    """
    start, goal = parameters.start, parameters.goal
    axes = reach_frame(start, goal)
    length = float(np.linalg.norm(goal - start))
    largest = max(max(size) for size in HALF_SIZE_M.values())
    if length < 2.0 * (END_CLEARANCE_M + largest):
        raise InputError(f"no obstacle fits between start and goal of a reach of {length:g} m")
    rng = np.random.default_rng(parameters.seed)
    near = parameters.near_settings
    yaws = rng.uniform(0.0, 2.0 * np.pi, parameters.settings)
    places: list[np.ndarray] = []
    while len(places) < parameters.settings:
        number = len(places)
        if number < near:
            local = _near_place(rng, (number + rng.random()) / near, length)
        else:
            local = _far_place(rng, length)
        centre = start + axes @ local
        solids = [obstacle(shape, centre, yaws[number]) for shape in SHAPES]
        ends = np.stack([start, goal])
        if min(solid.signed_distance(ends).min() for solid in solids) >= END_CLEARANCE_M:
            places.append(centre)
    return np.array(places).reshape(-1, 3), yaws


def _near_place(rng: np.random.Generator, along: float, length: float) -> np.ndarray:
    """Random place (3,) m in the local frame, uniform over the ellipse across the reach."""
    radius, angle = np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
    across = np.array(NEAR_M) * radius * np.array([np.cos(angle), np.sin(angle)])
    return np.array([length * (0.1 + 0.8 * along), *across])


def _far_place(rng: np.random.Generator, length: float) -> np.ndarray:
    while True:
        place = np.array([length * rng.uniform(*FAR_ALONG), *(np.array(FAR_M) * rng.uniform(-1.0, 1.0, 2))])
        beyond = place[0] - np.clip(place[0], 0.0, length)
        if np.hypot(beyond, np.hypot(place[1], place[2])) >= FAR_CLEARANCE_M:
            return place
