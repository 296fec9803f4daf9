"""Reaches through scenes of obstacles, from their onset to the goal, in their own local frames."""

from dataclasses import dataclass

import numpy as np
from pydantic import Field, PositiveInt

from structlearn.avoidance.look_ahead import LookAheadParameters
from structlearn.avoidance.network_training import EnsembleParameters, NetworkParameters
from structlearn.avoidance.shapes import Obstacle
from structlearn.ground.frames import local_frame
from structlearn.ground.params import Parameters
from structlearn.primitives.trajectory import Trajectory
from structlearn.recordings.demonstration import Demonstration


class SceneReachParameters(Parameters):
    """From recordings to reaches. Fields: `params.yaml`, `recorded_boxes.reaches`."""

    smoothing_hz: float = Field(gt=0, le=45)
    onset_share: float = Field(gt=0, lt=1)
    fastest_m_s: float = Field(gt=0)
    longest_s: float = Field(gt=0)
    samples: int = Field(ge=20, le=2000)


class SceneLearningParameters(Parameters):
    """Learning to reach through scenes. Fields: `params.yaml`, `recorded_boxes`."""

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
