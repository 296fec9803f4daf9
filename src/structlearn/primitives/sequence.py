"""Primitives in sequence without a jump in position, velocity or acceleration (eq. IV.12-14)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn import quaternion
from structlearn.primitives import kernels, orientation, position, regression, twist_swing
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory

OrientationPrimitive = orientation.QuaternionPrimitive | twist_swing.TwistSwingPrimitive

LARGEST_SHORT_WAY = np.radians(160.0)
"""rad; net turn up to which the text's quaternion primitive is used; its logarithm jumps at 180 degrees."""


@dataclass(frozen=True)
class PosePrimitive:
    """Position and orientation of one primitive; both run on one canonical system.

    Attributes:
        name: for tables and messages.
        position: movement of the point.
        orientation: movement of the orientation; None where none was recorded.
    """

    name: str
    position: position.PositionPrimitive
    orientation: OrientationPrimitive | None = None

    @property
    def duration(self) -> float:
        """Mean duration of the demonstrations in s."""
        return self.position.duration


@dataclass(frozen=True)
class PoseGoal:
    """Where a primitive is to end.

    Attributes:
        position: (3,) m.
        orientation: (4,) unit quaternion, or None for a movement without orientation.
    """

    position: np.ndarray
    orientation: np.ndarray | None = None


@dataclass(frozen=True)
class SequencePath:
    """An unrolled sequence.

    Attributes:
        position: (T, 3) path of the point.
        orientation: (T, 4) path of the orientation, or None.
        switches: (P + 1,) sample at which each primitive starts, and the last sample. The sample of a switch
            is the last of one primitive and the first of the next.
    """

    position: Trajectory
    orientation: OrientationTrajectory | None
    switches: np.ndarray


def fit_orientation(
    demonstrations: Sequence[OrientationTrajectory],
    method: regression.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> OrientationPrimitive:
    """Orientation primitive in the form that the demonstrations' largest net turn asks for.

    Args:
        demonstrations: each with (T_l, 4) orientations.
        method: regression of the forcing weights.
        kernel_count: number of kernels.

    Returns:
        The text's quaternion primitive below `LARGEST_SHORT_WAY`, the twist-swing primitive above.
    """
    if twist_swing.largest_turn(demonstrations) <= LARGEST_SHORT_WAY:
        return orientation.fit_quaternion(demonstrations, method, kernel_count)
    return twist_swing.fit_twist_swing(demonstrations, method, kernel_count)


def default_goals(primitives: Sequence[PosePrimitive]) -> list[PoseGoal]:
    """The demonstrations' mean goals."""
    return [
        PoseGoal(
            primitive.position.goal, None if primitive.orientation is None else primitive.orientation.goal
        )
        for primitive in primitives
    ]


def moved_goals(
    goals: Sequence[PoseGoal], offset: np.ndarray, turn: np.ndarray = quaternion.IDENTITY
) -> list[PoseGoal]:
    """Goals shifted by an offset (3,) in m and turned by a quaternion (4,), both in the base frame."""
    return [
        PoseGoal(
            goal.position + offset,
            None if goal.orientation is None else quaternion.product(turn, goal.orientation),
        )
        for goal in goals
    ]


def unroll(
    primitives: Sequence[PosePrimitive],
    dt: float,
    start: PoseGoal | None = None,
    goals: Sequence[PoseGoal] | None = None,
    durations: Sequence[float] | None = None,
) -> SequencePath:
    """Execute primitives one after another, the first one from rest.

    Each successor starts in the exact state in which its predecessor ended; its initial goal absorbs the
    difference to its own equilibrium (eq. IV.12-14).

    Args:
        primitives: with or without orientation, all alike.
        dt: sampling interval in s.
        start: pose at the start; default the first primitive's mean start.
        goals: one per primitive; default the demonstrations' means.
        durations: one per primitive in s; default the demonstrations' means.

    Returns:
        The whole path on one clock.
    """
    goals = default_goals(primitives) if goals is None else goals
    durations = [primitive.duration for primitive in primitives] if durations is None else durations
    first = primitives[0]
    if start is None:
        start = PoseGoal(first.position.start, None if first.orientation is None else first.orientation.start)
    point = (start.position, np.zeros(3), np.zeros(3))
    pose = (start.orientation, np.zeros(3), np.zeros(3))
    points, poses = [], []
    for primitive, goal, duration in zip(primitives, goals, durations, strict=True):
        path = primitive.position.unroll(dt, point[0], goal.position, duration, *point[1:])
        point = (path.position[-1], path.velocity[-1], path.acceleration[-1])
        points.append(path)
        if primitive.orientation is not None:
            turn = primitive.orientation.unroll(dt, pose[0], goal.orientation, duration, *pose[1:])
            pose = (turn.orientation[-1], turn.angular_velocity[-1], turn.angular_acceleration[-1])
            poses.append(turn)
    switches = np.cumsum([0, *(len(path.time) - 1 for path in points)])
    return SequencePath(_joined(points), _joined(poses) if poses else None, switches)


def _joined(
    paths: Sequence[Trajectory] | Sequence[OrientationTrajectory],
) -> Trajectory | OrientationTrajectory:
    """Paths end to end; the sample at a switch is kept once, from the successor."""
    samples = sum(len(path.time) - 1 for path in paths) + 1
    joined = {
        name: np.concatenate([getattr(path, name)[:-1] for path in paths] + [getattr(paths[-1], name)[-1:]])
        for name in vars(paths[0])
        if name != "time"
    }
    return type(paths[0])(time=paths[0].dt * np.arange(samples), **joined)
