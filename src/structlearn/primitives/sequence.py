"""Sequences of primitives, continuous in position, velocity and acceleration (eq. IV.12-14)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import compress
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.frames import UP
from structlearn.core.params import Parameters
from structlearn.primitives import canonical, kernels, orientation, twist_swing, vector
from structlearn.primitives.outputs import Switching
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory

if TYPE_CHECKING:
    import pandas as pd

OrientationPrimitive = orientation.QuaternionPrimitive | twist_swing.TwistSwingPrimitive
Path = TypeVar("Path", Trajectory, OrientationTrajectory)

LARGEST_SHORT_WAY = np.radians(160.0)
"""rad; largest net turn of the published quaternion primitive, whose logarithm jumps at 180 degrees."""

SHIFTED = 0.1  # of a joint's range, by which its start and goals are moved to show other ones


@dataclass(frozen=True)
class PosePrimitive:
    """Position and orientation of one primitive; both run on one canonical system."""

    name: str
    position: PositionPrimitive
    # None if no orientation was recorded
    orientation: OrientationPrimitive | None = None
    outputs: PositionPrimitive | None = None  # of C continuous outputs, without a frame
    switching: Switching | None = None  # of B digital outputs

    @property
    def duration(self) -> float:
        """Mean duration of the demonstrations in s."""
        return self.position.duration

    @property
    def rhythm(self) -> Rhythm | None:
        """Of a rhythmic movement."""
        return self.position.local.rhythm

    def repeated(self, cycles: float, amplitude: float = 1.0, first: float | None = None) -> "PosePrimitive":
        """As `ForcedPrimitive.repeated`; `amplitude`: of its position, relative."""
        orientation = self.orientation
        if isinstance(orientation, vector.ForcedPrimitive):
            orientation = orientation.repeated(cycles, first=first)
        outputs = None if self.outputs is None else self.outputs.repeated(cycles, first=first)
        position = self.position.repeated(cycles, amplitude, first)
        return replace(self, position=position, orientation=orientation, outputs=outputs)


@dataclass(frozen=True)
class PoseGoal:
    """Goal pose of a primitive."""

    position: np.ndarray  # (3,) m; of joints (J,)
    orientation: np.ndarray | None = None  # (4,) unit quaternion, or None for a movement without orientation


@dataclass(frozen=True)
class SequencePath:
    """An unrolled sequence."""

    position: Trajectory  # (T, 3) path of the point; of joints (T, J)
    orientation: OrientationTrajectory | None  # (T, 4) path of the orientation, or None
    # (P + 1,) sample at which each primitive starts, and the last sample. The sample of a switch is the last
    # of one primitive and the first of the next.
    switches: np.ndarray
    outputs: Trajectory | None = None  # (T, C)
    digital: np.ndarray | None = None  # (T, B) whether each is on


class GeneraliseParameters(Parameters):
    """A new situation in which a learned sequence is unrolled."""

    start_offset_m: tuple[float, float, float]
    goal_offset_m: tuple[float, float, float]
    goal_turn_deg: float = Field(ge=-180, le=180)
    duration_factor: float = Field(gt=0)


def fit_orientation(
    demonstrations: Sequence[OrientationTrajectory],
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> OrientationPrimitive:
    """Quaternion primitive if all demonstrations turn at most `LARGEST_SHORT_WAY`, else a twist-swing one."""
    if twist_swing.largest_turn(demonstrations) <= LARGEST_SHORT_WAY:
        return orientation.fit_quaternion(demonstrations, method, kernel_count)
    return twist_swing.fit_twist_swing(demonstrations, method, kernel_count)


def fit_orientation_subsets(
    demonstrations: Sequence[OrientationTrajectory], kernel_count: int = kernels.KERNEL_COUNT
) -> vector.SubsetFit[OrientationPrimitive]:
    """As `fit_orientation`, for some of the demonstrations at a time; twist-swing ones are fitted anew."""
    turns = twist_swing.Turns.of(demonstrations)
    quaternion_fit = cache(partial(orientation.fit_quaternion_subsets, demonstrations, kernel_count))

    def fit(used: np.ndarray, method: kernels.Regression) -> OrientationPrimitive:
        if turns.of_some(used).largest <= LARGEST_SHORT_WAY:
            return quaternion_fit()(used, method)
        return twist_swing.fit_twist_swing(list(compress(demonstrations, used)), method, kernel_count)

    return fit


def default_goals(primitives: Sequence[PosePrimitive]) -> list[PoseGoal]:
    """The mean goals of the demonstrations."""
    return [
        PoseGoal(
            primitive.position.goal, None if primitive.orientation is None else primitive.orientation.goal
        )
        for primitive in primitives
    ]


def default_start(primitives: Sequence[PosePrimitive]) -> PoseGoal:
    """The mean start of the first primitive's demonstrations."""
    first = primitives[0]
    return PoseGoal(first.position.start, None if first.orientation is None else first.orientation.start)


def moved_goals(
    goals: Sequence[PoseGoal], offset: np.ndarray, turn: np.ndarray = quaternion.IDENTITY
) -> list[PoseGoal]:
    """Goals shifted by an offset (3,) in m and rotated by a quaternion (4,), both in the base frame."""
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
    """Unroll primitives one after another, starting from rest.

    Each primitive starts in the exact state in which its predecessor ended; its initial goal absorbs the
    difference (eq. IV.12-14).

    `start`: initial pose; default: the first primitive's mean start. `goals`, `durations` (s): one per
    primitive; default: the means of the demonstrations.
    """
    goals = default_goals(primitives) if goals is None else goals
    durations = [primitive.duration for primitive in primitives] if durations is None else durations
    start = default_start(primitives) if start is None else start
    still = np.zeros_like(start.position)
    point, pose = (start.position, still, still), (start.orientation, np.zeros(3), np.zeros(3))
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
    outputs, states = unrolled_outputs(primitives, dt, durations, [len(path.time) for path in points])
    on = [*(own[:-1] for own in states), *(own[-1:] for own in states[-1:])]
    return SequencePath(
        _joined(points),
        _joined(poses) if poses else None,
        switches,
        _joined(outputs) if outputs else None,
        np.concatenate(on) if on else None,
    )


def unrolled_outputs(
    primitives: Sequence[PosePrimitive], dt: float, durations: Sequence[float], samples: Sequence[int]
) -> tuple[list[Trajectory], list[np.ndarray]]:
    """Continuous (T, C) and digital (T, B) outputs of each primitive, at so many samples; [] without any.

    A continuous output begins in the state in which the primitive before leaves it, as positions do.
    """
    paths, states, begun = list[Trajectory](), list[np.ndarray](), dict[str, Any]()
    for primitive, duration, count in zip(primitives, durations, samples, strict=True):
        if primitive.outputs is not None:
            until = dt * (count - 1)
            paths.append(primitive.outputs.unroll(dt, duration=duration, until=until, **begun))
            last = (paths[-1].position[-1], *(rate[-1] for rate in paths[-1].rates))
            begun = dict(zip(("start", "velocity", "acceleration"), last, strict=True))
        if primitive.switching is not None:
            tau = canonical.time_constant(duration)  # also of strokes, in which outputs are as at the start
            states.append(primitive.switching.states(canonical.phase(dt * np.arange(count), tau)[0]))
    return paths, states


def generalised(
    primitives: Sequence[PosePrimitive], dt: float, parameters: GeneraliseParameters
) -> SequencePath:
    """Unroll the sequence with another start, other goals and another duration.

    Of joints, whose ranges differ, start and goals are shifted by `SHIFTED` of each one's range.
    """
    start = default_start(primitives)
    durations = [parameters.duration_factor * primitive.duration for primitive in primitives]
    if primitives[0].position.frame == "none":
        goals = default_goals(primitives)
        shift = SHIFTED * np.ptp([start.position, *(goal.position for goal in goals)], axis=0)
        shifted = PoseGoal(start.position + shift)
        return unroll(primitives, dt, shifted, moved_goals(goals, -shift), durations)
    turn = quaternion.from_rotation_vector(np.radians(parameters.goal_turn_deg) * UP)
    return unroll(
        primitives,
        dt,
        PoseGoal(start.position + np.array(parameters.start_offset_m), start.orientation),
        moved_goals(default_goals(primitives), np.array(parameters.goal_offset_m), turn),
        durations,
    )


def sequence_table(
    path: SequencePath,
    names: Sequence[str],
    joints: Sequence[str] = (),
    outputs: Sequence[str] = (),
    digital: Sequence[str] = (),
) -> "pd.DataFrame":
    """A path as a table: `primitive`, `time_s`, then the signals with their axis in the name.

    Position `x`, `y`, `z` in m, velocity `vx` ... in m/s, acceleration `ax` ... in m/s^2 and, with an
    orientation, quaternion `qw`, `qx`, `qy`, `qz`, angular velocity `wx` ... in rad/s, angular acceleration
    `dwx` ... in rad/s^2. The sample of a switch belongs to the successor. Of `joints`, by their names:
    `q.NAME`, `vq.NAME`, `aq.NAME`. Outputs by theirs: `output.NAME`, and `digital.NAME`, 1 if on.
    """
    import pandas as pd  # is not on a robot's computer

    lengths = np.diff(path.switches)
    lengths[-1] += 1
    signals = {"": path.position.position, "v": path.position.velocity, "a": path.position.acceleration}
    if path.orientation is not None:
        signals |= {
            "q": path.orientation.orientation,
            "w": path.orientation.angular_velocity,
            "dw": path.orientation.angular_acceleration,
        }
    columns = {
        f"{prefix}{axis}": values[:, place]
        for prefix, values in signals.items()
        for place, axis in enumerate(
            "wxyz" if prefix == "q" else [f"q.{joint}" for joint in joints] if joints else "xyz"
        )
    }
    if path.outputs is not None:
        columns |= {
            f"output.{name}": values for name, values in zip(outputs, path.outputs.position.T, strict=True)
        }
    if path.digital is not None:
        columns |= {
            f"digital.{name}": on.astype(int) for name, on in zip(digital, path.digital.T, strict=True)
        }
    return pd.DataFrame({"primitive": np.repeat(names, lengths), "time_s": path.position.time, **columns})


def largest_acceleration_jump(table: "pd.DataFrame") -> float:
    """Largest acceleration change from one sample to the next at a switch, over the largest acceleration.

    Without eq. IV.12 it would be of the order of 1. `table`: from `sequence_table`. 0 for a single primitive.
    """
    acceleration = columns_of(table, "a").to_numpy()
    names = table["primitive"].to_numpy()
    jumps = np.linalg.norm(np.diff(acceleration, axis=0)[names[1:] != names[:-1]], axis=1)
    return float(jumps.max(initial=0.0) / np.linalg.norm(acceleration, axis=1).max())


def columns_of(table: "pd.DataFrame", prefix: str = "") -> "pd.DataFrame":
    """Columns of a `sequence_table`: position, or with the prefix v or a its rates, of x, y, z or joints."""
    joints = [name for name in table if name.startswith(f"{prefix}q.")]
    return table[joints or [f"{prefix}{axis}" for axis in "xyz"]]


def _joined(paths: Sequence[Path]) -> Path:
    """Paths end to end; the sample at a switch is kept once, from the successor."""
    samples = sum(len(path.time) - 1 for path in paths) + 1
    joined = {
        name: np.concatenate([getattr(path, name)[:-1] for path in paths] + [getattr(paths[-1], name)[-1:]])
        for name in vars(paths[0])
        if name != "time"
    }
    return type(paths[0])(time=paths[0].dt * np.arange(samples), **joined)
