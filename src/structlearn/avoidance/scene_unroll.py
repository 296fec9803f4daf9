"""Reaches through scenes of several obstacles at rest, a batch at once, with a model in the loop (IV.8.4).

Everything is in each reach's own local frame and in units of its duration: coupling terms are scaled by
tau^2, so a path does not depend on how long it takes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from pydantic import Field, PositiveInt

from structlearn.avoidance.features import CouplingModel, features
from structlearn.avoidance.look_ahead import CostToGo, LookAheadParameters, scene_features
from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters
from structlearn.avoidance.postprocessing import Deadline, GoalReach, post_processed
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.frames import local_frame
from structlearn.core.params import Parameters
from structlearn.primitives import canonical, transformation
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration

TAU = canonical.time_constant(1.0)  # time constant in durations


@dataclass(frozen=True)
class Scenes:
    """B scenes as models see them."""

    start: np.ndarray  # (B, 3) m, base frame
    frame: np.ndarray  # (B, 3, 3) local to base
    goal: np.ndarray  # (B, 3) m, local frame
    # (B, O, P, 3) m, local frame, surfaces of the obstacles; a scene with fewer has one repeatedly
    clouds: np.ndarray
    ways: Sequence[CostToGo]  # of each scene

    def __len__(self) -> int:
        return len(self.start)

    def take(self, places: Sequence[int]) -> Self:
        """Some of the scenes, in their order and as often as named."""
        return type(self)(
            self.start[places],
            self.frame[places],
            self.goal[places],
            self.clouds[places],
            [self.ways[place] for place in places],
        )


@dataclass(frozen=True)
class Seen:
    """What is seen of one obstacle of each of B scenes: the nearest."""

    features: np.ndarray  # (B, 17)
    first_x: np.ndarray  # (B,) m, smallest x of its points
    last_x: np.ndarray  # (B,) m, largest x of its points


def local_clouds(
    obstacles: Sequence[Sequence[Obstacle]], start: np.ndarray, frame: np.ndarray, count: int
) -> np.ndarray:
    """Surfaces of the obstacles of B scenes in their local frames, `Scenes.clouds`.

    `obstacles`: of each scene, at least one; `start` (B, 3) m, base frame; `frame` (B, 3, 3) local to base.
    """
    most = max(map(len, obstacles))
    clouds = [
        [(one.cloud(count) - origin) @ axes for one in (*its, *[its[0]] * (most - len(its)))]
        for its, origin, axes in zip(obstacles, start, frame, strict=True)
    ]
    return np.array(clouds)


def nearest_seen(position: np.ndarray, scaled_velocity: np.ndarray, clouds: np.ndarray) -> Seen:
    """The text's features of the obstacle whose surface is nearest to the hand.

    `position` (B, 3) m; `scaled_velocity` (B, 3) tau v, m; `clouds` (B, O, P, 3) m.
    """
    every = features(position[:, None], scaled_velocity[:, None], 1.0, clouds, clouds.mean(axis=2))
    nearest = np.linalg.norm(every[..., [3, 6, 9]], axis=-1).argmin(axis=1)
    rows = np.arange(len(position))
    x = clouds[rows, nearest, :, 0]
    return Seen(every[rows, nearest], x.min(axis=1), x.max(axis=1))


Feedback = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""Sample, position (B, 3) m, tau v (B, 3) m -> coupling term (B, 3) m."""


def feedback_of_nearest(model: CouplingModel, scenes: Scenes, samples: int, decay_per_m2: float) -> Feedback:
    """A model of the text's features, with the text's post-processing, for the nearest obstacle.

    `model`: of features, phase and phase velocity; `scenes`: B of them; `decay_per_m2`: k past the obstacle
    (`postprocessing`).
    """
    phase = phases(samples)

    def at(k: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        seen = nearest_seen(position, scaled_velocity, scenes.clouds)
        wanted = model(seen.features, *(np.full(len(position), values[k]) for values in phase))
        bounds = (seen.first_x, seen.last_x, scenes.goal[:, 0])
        return post_processed(wanted, position[:, 0], *bounds, decay_per_m2)

    return at


def feedback_of_scene(model: CouplingModel, scenes: Scenes, samples: int, ahead: Sequence[float]) -> Feedback:
    """A model of the scene's features; arguments as `feedback_of_nearest`, `ahead` as `scene_features`."""
    phase = phases(samples)

    def at(k: int, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
        rows = [
            scene_features(scenes.ways[b], x, v, scenes.start[b], scenes.frame[b], scenes.goal[b], ahead)
            for b, (x, v) in enumerate(zip(position[:, None], scaled_velocity[:, None], strict=True))
        ]
        return model(np.concatenate(rows), *(np.full(len(position), values[k]) for values in phase))

    return at


def phases(samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Phase and phase velocity (T,) of a movement of so many samples."""
    return canonical.phase(np.linspace(0.0, 1.0, samples), TAU)


def unroll_through(
    primitive: VectorPrimitive,
    goals: np.ndarray,
    feedback: Feedback | None,
    samples: int,
    end_limit_m: float | None = None,
    return_coupling: float = 0.0,
) -> Trajectory:
    """Unroll a primitive of duration one from the origin to B goals.

    As in `avoiding_unroll` the feedback begins with the second sample.

    Args:
        primitive: in the local frame.
        goals: (B, 3) m, local frame.
        feedback: None for the primitive alone.
        samples: T, from the start to the prescribed end.
        end_limit_m: how far off the primitive's own end feedback may leave the hand (`GoalReach`).
        return_coupling: likewise.

    Returns:
        (B, T, 3) positions relative to the start, velocities and accelerations per duration.
    """
    time = np.linspace(0.0, 1.0, samples)
    forcing = primitive.forcing(time, np.zeros((len(goals), 1, 3)), goals[:, None], 1.0)
    deadlines = [] if end_limit_m is None else [Deadline(samples - 1, end_limit_m)]
    reach = GoalReach(goals.shape, time[1] / TAU, deadlines, return_coupling)

    def coupling(k: int, x: np.ndarray, xd: np.ndarray) -> np.ndarray:
        if k == 0 or feedback is None:
            return np.zeros(goals.shape)
        wanted = feedback(k, x, TAU * xd)
        acts = reach.admissible(k, wanted) if deadlines else wanted
        reach.advance(acts)
        return acts

    state = (primitive.velocity, primitive.acceleration)
    return transformation.unroll(np.zeros(goals.shape), goals, forcing, time[1], TAU, *state, coupling)


class SceneReachParameters(Parameters):
    """From recordings to reaches. Fields: `stages/tasks/params.yaml`, `defaults.obstacles.reaches`."""

    smoothing_hz: float = Field(gt=0, le=45)
    onset_share: float = Field(gt=0, lt=1)
    fastest_m_s: float = Field(gt=0)
    longest_s: float = Field(gt=0)
    samples: int = Field(ge=20, le=2000)


class SceneLearningParameters(Parameters):
    """Learning to reach through scenes. Fields: `stages/tasks/params.yaml`, `defaults.obstacles`."""

    reaches: SceneReachParameters
    folds: int = Field(ge=2)
    hand_radius_m: float = Field(gt=0)
    straight_share: float = Field(gt=0, lt=1)
    keep_every: PositiveInt
    cloud_count: int = Field(ge=6)
    look_ahead: LookAheadParameters
    network: EnsembleParameters
    return_stiffness: float = Field(ge=0)
    end_limit_m: float = Field(gt=0)
    return_coupling: float = Field(ge=0)
    text_network: NetworkParameters
    text_decay_per_m2: float = Field(ge=0)


@dataclass(frozen=True)
class SceneReach:
    """One person's reach through a scene."""

    name: str  # of the recording
    person: str  # who
    path: Trajectory  # (T, 3) in the local frame, relative to the start; time in durations, from 0 to 1
    start: np.ndarray  # (3,) m, base frame
    frame: np.ndarray  # (3, 3) local to base
    duration_s: float  # s
    obstacles: tuple[Obstacle, ...]  # base frame
    walls: tuple[Obstacle, ...]  # what else the hand could meet, base frame

    @property
    def goal(self) -> np.ndarray:
        """(3,) m, local frame: where the target was reached."""
        return self.path.position[-1]

    @property
    def in_base_frame(self) -> np.ndarray:
        """(T, 3) m."""
        return self.start + self.path.position @ self.frame.T

    @property
    def shapes(self) -> tuple[Obstacle, ...]:
        """Everything that is in the way."""
        return (*self.obstacles, *self.walls)


def cut_reach(
    trial: Demonstration,
    name: str,
    person: str,
    smooth: Trajectory,
    part: slice,
    obstacles: tuple[Obstacle, ...],
    walls: tuple[Obstacle, ...],
    parameters: SceneReachParameters,
) -> SceneReach | str:
    """One reach of a recording.

    `smooth` (T, 3) m, its smoothed positions with their derivatives; `part`: samples of the reach;
    `obstacles`: base frame; `walls`: base frame. Returns the reach, or why there is none.
    """
    time = trial.time[part]
    duration = float(time[-1] - time[0])
    jump = np.linalg.norm(np.diff(trial.position[part], axis=0), axis=1).max() / trial.dt
    if jump > parameters.fastest_m_s:
        return f"tracking jumps, {jump:.1f} m/s"
    if duration > parameters.longest_s:
        return f"takes {duration:.1f} s"
    start, goal = smooth.position[part][[0, -1]]
    frame = local_frame(start, goal)
    time = (time - time[0]) / duration
    signals = (
        smooth.position[part] - start,
        duration * smooth.velocity[part],
        duration**2 * smooth.acceleration[part],
    )
    grid = np.linspace(0.0, 1.0, parameters.samples)
    path = Trajectory(grid, *(_resampled(grid, time, signal @ frame) for signal in signals))
    return SceneReach(name, person, path, start, frame, duration, obstacles, walls)


def _resampled(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(T, 3) at the times of a grid (T,), linearly: the signal is smooth over many samples."""
    return np.stack([np.interp(grid, time, column) for column in values.T], axis=1)
