"""Reaches of people through scenes of several obstacles, cut from recordings (IV.8).

Everything is in the local frame of each reach and in units of its duration; coupling terms are scaled by
tau^2, so a path does not depend on its duration.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field, PositiveInt

from structlearn.avoidance.look_ahead import LookAheadParameters
from structlearn.avoidance.network_training import AvoidanceNetworkParameters, EnsembleParameters
from structlearn.avoidance.shapes import Obstacle, recorded_obstacle
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.core.params import Parameters
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.readers.demonstration import Demonstration

ONSET_SHARE = 0.05  # of the peak speed, below which the hand has not begun: a usual criterion
FASTEST_M_S = 2.5  # between two samples; hands are slower, so a higher speed is a tracking error
OPEN = "has no obstacles"  # reason for leaving out a reach


class SceneReachParameters(Parameters):
    """Cutting of reaches. Fields: `defaults.obstacles.reaches`."""

    smoothing_hz: float = Field(gt=0, le=45)
    longest_s: float = Field(gt=0)
    samples: int = Field(ge=20, le=2000)


class SceneLearningParameters(Parameters):
    """Learning to reach through scenes. Fields: `defaults.obstacles`."""

    tuned_on: tuple[str, ...]
    ignored: tuple[str, ...]
    walls: tuple[str, ...]
    reaches: SceneReachParameters
    folds: int = Field(ge=2)
    hand_radius_m: float = Field(gt=0)
    keep_every: PositiveInt
    cloud_count: int = Field(ge=6)
    look_ahead: LookAheadParameters
    network: EnsembleParameters
    published_network: AvoidanceNetworkParameters


@dataclass(frozen=True)
class SceneReach:
    """One person's reach through a scene."""

    name: str  # of the recording
    person: str
    path: Trajectory  # (T, 3) in the local frame, relative to the start; time in durations, from 0 to 1
    start: np.ndarray  # (3,) m, base frame
    frame: np.ndarray  # (3, 3) local to base
    duration_s: float
    obstacles: tuple[Obstacle, ...]  # base frame
    walls: tuple[Obstacle, ...]  # further shapes that the hand could hit, base frame

    @property
    def goal(self) -> np.ndarray:
        """(3,) m, local frame: position at which the target was reached."""
        return self.path.position[-1]

    @property
    def bend(self) -> float:
        """Largest distance from the straight line, relative to its length."""
        return float(np.linalg.norm(self.path.position[:, 1:], axis=1).max() / self.goal[0])

    @property
    def in_base_frame(self) -> np.ndarray:
        """Path (T, 3) m in the base frame."""
        return self.start + self.path.position @ self.frame.T


def reaches_past_obstacles(
    runs: Sequence[Demonstration], parameters: SceneLearningParameters
) -> tuple[list[SceneReach], pd.DataFrame]:
    """Cut the reach of each run; runs left out have a row `trial`, `person`, `reason`.

    A reach lasts while the hand's speed is above a share of its peak, from the first to the last crossing. If
    the provenance has a time after the onset, `moved_s`, and the time of reaching the target, `reached_s`,
    the reach begins where the speed was last below that share before `moved_s` (or at the slowest sample, if
    the run began too late for that), and ends at the target. Raises InputError: no run has obstacles, or a
    run has no `person` in its provenance.
    """
    reaches, left_out = [], []
    for run in runs:
        reach = _reach(run, parameters)
        if isinstance(reach, str):
            left_out.append((run.name, run.provenance["person"], reach))
        else:
            reaches.append(reach)
    if left_out and not reaches and all(reason == OPEN for _, _, reason in left_out):
        raise InputError(
            f"{left_out[0][0]}: {OPEN}, nor have the others; name their topic, or put obstacles.csv beside "
            "them"
        )
    return reaches, pd.DataFrame(left_out, columns=["trial", "person", "reason"])


def _reach(run: Demonstration, parameters: SceneLearningParameters) -> SceneReach | str:
    """The reach of a run, or the reason why there is none."""
    if "person" not in run.provenance:
        raise InputError(f"{run.name}: its provenance does not say whose reach it is")
    walls = tuple(recorded_obstacle(shape) for shape in run.shapes if shape.name.startswith(parameters.walls))
    others = parameters.walls + parameters.ignored
    obstacles = tuple(recorded_obstacle(shape) for shape in run.shapes if not shape.name.startswith(others))
    if not obstacles:
        return OPEN
    cutting = parameters.reaches
    smooth = differentiated(run.position, run.dt, cutting.smoothing_hz)
    speed = np.linalg.norm(smooth.velocity, axis=1)
    if "moved_s" in run.provenance:
        times = [float(run.provenance[key]) for key in ("moved_s", "reached_s")]
        begins, ends = (int(np.searchsorted(run.time, at - 1e-6)) for at in times)
        ends = min(ends, len(run.time) - 1)
        if begins >= ends:
            return "does not move before it ends"
        before = speed[: begins + 1]
        slow = np.flatnonzero(before < ONSET_SHARE * speed[begins : ends + 1].max())
        part = slice(int(slow[-1]) if len(slow) else int(before.argmin()), ends + 1)
    else:
        moving = np.flatnonzero(speed >= ONSET_SHARE * speed.max())
        part = slice(max(int(moving[0]) - 1, 0), int(moving[-1]) + 2)
    time = run.time[part]
    duration = float(time[-1] - time[0])
    jump = np.linalg.norm(np.diff(run.position[part], axis=0), axis=1).max() / run.dt
    if jump > FASTEST_M_S:
        return f"tracking jumps, {jump:.1f} m/s"
    if duration > cutting.longest_s:
        return f"takes {duration:.1f} s"
    start, goal = smooth.position[part][[0, -1]]
    frame = local_frame(start, goal)
    grid, time = np.linspace(0.0, 1.0, cutting.samples), (time - time[0]) / duration
    factors = (smooth.position - start, duration * smooth.velocity, duration**2 * smooth.acceleration)
    signals = (signal[part] @ frame for signal in factors)
    # linear interpolation suffices: the signals are smooth over many samples
    path = [np.stack([np.interp(grid, time, column) for column in signal.T], axis=1) for signal in signals]
    trajectory = Trajectory(grid, *path)
    return SceneReach(
        run.name, run.provenance["person"], trajectory, start, frame, duration, obstacles, walls
    )
