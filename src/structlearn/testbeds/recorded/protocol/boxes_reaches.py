"""Recorded trials past boxes as reaches: from their onset to the target, in their own local frames."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.avoidance.shapes import Obstacle, recorded_obstacle
from structlearn.ground.errors import InputError
from structlearn.ground.frames import local_frame
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.reaches_past_boxes import BOUNDARY, BOX
from structlearn.testbeds.recorded.protocol.boxes_parameters import BoxReachParameters


@dataclass(frozen=True)
class BoxReach:
    """One person's reach past boxes.

    Attributes:
        name: of the trial.
        person: who.
        path: (T, 3) in the local frame, relative to the start; time in durations, from 0 to 1.
        start: (3,) m, base frame.
        frame: (3, 3) local to base.
        duration_s: s.
        boxes: base frame.
        walls: of the shelf, base frame.
    """

    name: str
    person: str
    path: Trajectory
    start: np.ndarray
    frame: np.ndarray
    duration_s: float
    boxes: tuple[Obstacle, ...]
    walls: tuple[Obstacle, ...]

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
        return (*self.boxes, *self.walls)


def reaches_past_boxes(
    trials: Sequence[Demonstration], parameters: BoxReachParameters
) -> tuple[list[BoxReach], pd.DataFrame]:
    """The reaches of some trials, and which were left out.

    A trial says when its hand had moved, well after it began to: the reach begins where its speed, looked at
    backwards from there, first is below a share of its peak, or with the slowest sample where the recording
    began too late for that. It ends when the target was reached.

    Args:
        trials: with provenance and shapes of `recordings.reaches_past_boxes`.
        parameters: see there.

    Returns:
        The reaches, and per trial left out `trial`, `person` and `reason`.

    Raises:
        InputError: a trial has no boxes, or does not say whose it is and when it moved.
    """
    reaches, left_out = [], []
    for trial in trials:
        found = _reach(trial, parameters)
        if isinstance(found, str):
            left_out.append((trial.name, trial.provenance["person"], found))
        else:
            reaches.append(found)
    return reaches, pd.DataFrame(left_out, columns=["trial", "person", "reason"])


def _reach(trial: Demonstration, parameters: BoxReachParameters) -> BoxReach | str:
    """The reach of a trial, or why there is none."""
    try:
        person = trial.provenance["person"]
        moved, reached = (float(trial.provenance[key]) for key in ("moved_s", "reached_s"))
    except (KeyError, ValueError) as error:
        raise InputError(f"{trial.name}: its provenance lacks {error}") from error
    boxes, walls = (
        tuple(recorded_obstacle(shape) for shape in trial.shapes if shape.name.startswith(kind))
        for kind in (BOX, BOUNDARY)
    )
    if not boxes:
        raise InputError(f"{trial.name}: has no boxes")
    smooth = differentiated(trial.position, trial.dt, parameters.smoothing_hz)
    begins, ends = (int(np.searchsorted(trial.time, at - 1e-6)) for at in (moved, reached))
    ends = min(ends, len(trial.time) - 1)
    speed = np.linalg.norm(smooth.velocity, axis=1)
    before = speed[: begins + 1]
    slow = np.flatnonzero(before < parameters.onset_share * speed[begins : ends + 1].max())
    onset = int(slow[-1]) if len(slow) else int(before.argmin())
    part = slice(onset, ends + 1)
    duration = float(trial.time[ends] - trial.time[onset])
    jump = np.linalg.norm(np.diff(trial.position[part], axis=0), axis=1).max() / trial.dt
    if jump > parameters.fastest_m_s:
        return f"tracking jumps, {jump:.1f} m/s"
    if duration > parameters.longest_s:
        return f"takes {duration:.1f} s"
    start, goal = smooth.position[part][[0, -1]]
    frame = local_frame(start, goal)
    time = (trial.time[part] - trial.time[part][0]) / duration
    signals = (
        smooth.position[part] - start,
        duration * smooth.velocity[part],
        duration**2 * smooth.acceleration[part],
    )
    grid = np.linspace(0.0, 1.0, parameters.samples)
    path = Trajectory(grid, *(_resampled(grid, time, signal @ frame) for signal in signals))
    return BoxReach(trial.name, person, path, start, frame, duration, boxes, walls)


def _resampled(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(T, 3) at the times of a grid (T,), linearly: the signal is smooth over many samples."""
    return np.stack([np.interp(grid, time, column) for column in values.T], axis=1)
