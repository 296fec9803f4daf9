"""Poses that are not published: computed from /tf, or from joint positions by the robot's kinematics.

Each transform on /tf is a separate stream: the pose of a child frame in its parent's. Transforms at rest,
those on the static topic and those that never change, have no clock. The others are combined on the clock of
the slowest (`clock.shared_stamps`): positions are interpolated linearly, orientations by slerp.

With a URDF, Pinocchio computes the pose of a link in the root's frame. Joints are matched by name; those that
are not between root and tip are ignored. Angles in degrees look like fast motion over many turns, so they are
held against the URDF's limits.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import home_path
from structlearn.readers.clock import NORM_TOLERANCE, in_order, linear, shared_stamps, slerp
from structlearn.readers.decoded_messages import decoded
from structlearn.readers.demonstration import Stream
from structlearn.readers.joint_streams import JointSeries
from structlearn.readers.messages import fields_named, nanoseconds, numbers
from structlearn.readers.raw_messages import RawMessages
from structlearn.readers.source import JointPose, StampPolicy, TransformPose
from structlearn.readers.urdf_file import check_limits, pinocchio_model, urdf_path

Edge = tuple[str, str]  # parent and child frame

# rad beyond its limit at which a joint cannot be, far more than calibration errors; without limits, two turns
BEYOND, WOUND = 0.5, 4.0 * np.pi


@dataclass(frozen=True)
class TransformSeries:
    """One transform as received: the child's pose in the parent's frame."""

    parent: str
    child: str
    stamps: np.ndarray  # (T,) int64 ns in order of arrival
    values: np.ndarray  # (T, 7) m, then unit quaternion w, x, y, z

    @property
    def moves(self) -> bool:
        """Whether it ever changes."""
        return bool((self.values != self.values[0]).any())


def transform_series(where: str, messages: RawMessages, policy: StampPolicy) -> dict[Edge, TransformSeries]:
    """Every transform on a topic, in order of arrival; the leading slash of ROS 1 frames is removed."""
    pieces = defaultdict(list)
    with fields_named(where):
        for group in decoded(where, messages):
            for transform in group.message.transforms:
                edge = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
                values = np.array(numbers(transform.transform, "translation", "rotation"), dtype=float)
                stamps = np.atleast_1d(nanoseconds(transform.header.stamp))
                pieces[edge].append((group.rows, stamps, values.reshape(7, len(group.rows)).T))
    series = {}
    for edge, parts_of_edge in pieces.items():
        rows, stamps, values = (np.concatenate(parts) for parts in zip(*parts_of_edge, strict=True))
        order = np.argsort(rows, kind="stable")
        rows, stamps, values = rows[order], stamps[order], values[order][:, [0, 1, 2, 6, 3, 4, 5]]
        norms = np.linalg.norm(values[:, 3:], axis=1)
        if (np.abs(norms - 1.0) > NORM_TOLERANCE).any():
            norm = norms[np.argmax(np.abs(norms - 1.0))]
            raise InputError(f"{where}: {_named(edge)}: quaternion has norm {norm:.6g}, not 1")
        if policy.clock == "log" or not stamps.any():
            stamps = messages.log_times[rows]
        series[edge] = TransformSeries(*edge, stamps, values)
    return series


def chain(where: str, edges: Sequence[Edge], parent: str, child: str) -> list[Edge]:
    """Transforms along the path from one frame to another, in order; either may be above the other."""
    parent, child = parent.lstrip("/"), child.lstrip("/")
    frames = sorted({frame for edge in edges for frame in edge})
    for frame in (parent, child):
        if frame not in frames:
            raise InputError(f"{where}: has no frame '{frame}'; it has {', '.join(frames) or 'none'}")
    path_to: dict[str, list[Edge]] = {parent: []}
    waiting = [parent]
    while waiting and child not in path_to:
        frame = waiting.pop(0)
        for edge in edges:
            for here, there in (edge, edge[::-1]):
                if here == frame and there not in path_to:
                    path_to[there] = [*path_to[frame], edge]
                    waiting.append(there)
    if child not in path_to:
        reached = ", ".join(sorted(path_to))
        raise InputError(f"{where}: no transforms lead from '{parent}' to '{child}', only to {reached}")
    for _, below in path_to[child]:
        above = sorted(frame_above for frame_above, frame_below in edges if frame_below == below)
        if len(above) > 1:
            raise InputError(f"{where}: frame '{below}' has several parents: {', '.join(above)}")
    return path_to[child]


def transform_pose(
    where: str, messages: Mapping[str, RawMessages], pose: TransformPose, policy: StampPolicy
) -> tuple[Stream, str | None]:
    """Stream of the pose of one frame in another, and how stamps of its transforms were corrected.

    `messages`: per topic of `pose.topics` that the file has.
    """
    of_topic = [
        transform_series(f"{where}: topic '{topic}'", messages[topic], policy) if topic in messages else {}
        for topic in pose.topics
    ]
    moving = {edge for edge, transform in of_topic[0].items() if transform.moves}
    series = of_topic[1] | of_topic[0]  # a transform on both topics is not static
    where = f"{where}: topic '{pose.topic}'"
    path = chain(where, list(series), pose.parent, pose.child)
    moving &= set(path)
    if not moving:
        raise InputError(f"{where}: '{pose.child}' does not move in '{pose.parent}'")
    notes = []
    for edge in path:
        if edge in moving:
            transform = series[edge]
            rows, note = in_order(f"{where}: {_named(edge)}", transform.stamps, policy)
            if note is not None:
                notes.append(f"{note} of {_named(edge)}")
                stamps, values = transform.stamps[rows], transform.values[rows]
                series[edge] = replace(transform, stamps=stamps, values=values)
    ticks = shared_stamps([series[edge].stamps for edge in path if edge in moving])
    if len(ticks) < 2:
        names = ", ".join(f"'{above}' to '{below}'" for above, below in path if (above, below) in moving)
        raise InputError(f"{where}: the transforms {names} are not there at one time")
    frame = pose.parent.lstrip("/")
    position = np.zeros((len(ticks), 3))
    orientation = np.tile([1.0, 0.0, 0.0, 0.0], (len(ticks), 1))
    for edge in path:
        transform = series[edge]
        step, turn = np.split(np.tile(transform.values[-1], (len(ticks), 1)), [3], axis=1)
        if edge in moving:
            at, stamps = (ticks - ticks[0]).astype(float), (transform.stamps - ticks[0]).astype(float)
            step = linear(at, stamps, transform.values[:, :3])
            turn = slerp(at, stamps, transform.values[:, 3:])
        if edge[0] != frame:  # upwards: invert, to get the parent's pose in the child's frame
            turn = quaternion.conjugate(turn)
            step = -quaternion.rotate(turn, step)
        frame = edge[1] if edge[0] == frame else edge[0]
        position = position + quaternion.rotate(orientation, step)
        orientation = quaternion.product(orientation, turn)
    orientation = quaternion.sign_continuous(quaternion.normalised(orientation))
    return Stream(pose.topic, "pose", ticks, np.hstack([position, orientation])), ", ".join(notes) or None


def _named(edge: Edge) -> str:
    return f"transform from '{edge[0]}' to '{edge[1]}'"


def joint_pose(where: str, series: Sequence[JointSeries], pose: JointPose) -> Stream:
    """Stream of a link's pose, on the clock of the slowest of its joints (`clock.shared_stamps`)."""
    model, frame, joints = _kinematics(urdf_path(str(home_path(pose.urdf))), pose.tip)
    logged = [name for part in series for name in part.names]
    if unknown := [name for name, _ in pose.joints if name not in logged]:
        raise InputError(f"{where}: has no joints {', '.join(unknown)}, which the entry renames")
    series = [part.renamed(dict(pose.joints)) for part in series]
    measured = [part for whole in series if (part := whole.of_joints(list(joints))) is not None]
    present = [name for part in measured for name in part.names]
    if missing := [name for name in joints if name not in present]:
        raise InputError(
            f"{where}: lacks the joints {', '.join(missing)}, which move '{pose.tip}' in {pose.urdf}; it has "
            f"{', '.join(logged) or 'no names'}; `joints: {{recorded: in the URDF}}` maps names that differ"
        )
    without = (part for part in measured if "joint_positions" not in part.values)
    if unmeasured := [name for part in without for name in part.names]:
        raise InputError(f"{where}: has no positions of the joints {', '.join(unmeasured)}")
    ticks = shared_stamps([part.stamps for part in measured])
    if len(ticks) < 2:
        raise InputError(f"{where}: the joints {', '.join(present)} are not there at one time")
    columns: dict[str, np.ndarray] = {}
    for part in measured:
        at, stamps = (ticks - ticks[0]).astype(float), (part.stamps - ticks[0]).astype(float)
        sampled = linear(at, stamps, part.values["joint_positions"])
        columns |= dict(zip(part.names, sampled.T, strict=True))
    recorded = np.stack([columns[name] for name in joints], axis=1)
    turning = [name for name, joint in joints.items() if _turns(joint)]
    positions = recorded
    if pose.units == "deg":
        positions = np.where([name in turning for name in joints], np.radians(recorded), recorded)
    if pose.units != "rad":
        angles = recorded[:, [name in turning for name in joints]]
        _check_units(where, pose, angles, {name: _range(model, joints[name]) for name in turning})
    return Stream(pose.topic, "pose", ticks, _poses(model, frame, list(joints.values()), positions))


def joints_to(urdf: Path, tip: str) -> list[str]:
    """Names of the joints from the root to a link. Raises InputError: none moves it, or it is no URDF."""
    return list(_kinematics(urdf, tip)[2])


def in_radians(series: JointSeries, pose: JointPose) -> JointSeries:
    """Series in which the joints that move a pose's link turn in rad and rad/s."""
    if pose.units != "deg":
        return series
    _, _, joints = _kinematics(urdf_path(str(home_path(pose.urdf))), pose.tip)
    turning = {name for name, joint in joints.items() if _turns(joint)}
    scales = [np.pi / 180.0 if dict(pose.joints).get(name, name) in turning else 1.0 for name in series.names]
    values = {
        kind: signal if kind == "joint_torques" else signal * scales for kind, signal in series.values.items()
    }
    return replace(series, values=values)


def _check_units(
    where: str, pose: JointPose, angles: np.ndarray, ranges: Mapping[str, tuple[float, float]]
) -> None:
    """Raise InputError if recorded angles (T, n) cannot have the units of the entry.

    `ranges`: lower and upper bound in rad by joint, in the order of the columns.
    """
    if not angles.size or not np.isfinite(angles).all():
        return  # another check names what is not finite
    low, high = np.array(list(ranges.values())).T

    def farthest(values: np.ndarray) -> int | None:
        """Joint that goes farthest beyond its bounds; None: all are within."""
        over = np.maximum(values.max(axis=0) - high, low - values.min(axis=0))
        return int(over.argmax()) if over.max() > BEYOND else None

    largest = float(np.abs(angles).max())
    if pose.units == "deg" and largest <= 2.0 * np.pi:
        raise InputError(f"{where}: no angle is above {largest:.3g}: rad, and not `units: deg`?")
    place = farthest(angles if pose.units is None else np.radians(angles))
    if place is None:
        return
    name, (lower, upper) = list(ranges.items())[place]
    middle = 0.5 * (lower + upper) if pose.units is None else np.degrees(0.5 * (lower + upper))
    value = angles[np.abs(angles[:, place] - middle).argmax(), place]
    limit, unit = (upper if value > middle else lower), "rad"
    if pose.units == "deg":
        limit, unit = np.degrees(limit), "degrees"
    known = f"beyond its limit of {limit:.4g} {unit} in {pose.urdf}"
    if (lower, upper) == (-WOUND, WOUND):
        known = f"which are more than two turns in {unit}"
    offer = ""
    if pose.units is None and farthest(np.radians(angles)) is None:
        offer = ": degrees? then `units: deg` beside `urdf`; `units: rad` reads it as it is"
    elif pose.units is None:
        offer = ", as degrees too: in which units is it? `units: rad` reads it as it is"
    raise InputError(f"{where}: {name} goes to {value:.4g}, {known}{offer}")


def _kinematics(path: Path, tip: str) -> tuple[Any, int, dict[str, Any]]:
    """Pinocchio's model, the index of a link's frame, and the joints from the root to it by name."""
    import pinocchio  # takes half a second, and is only needed for computed poses

    model = pinocchio_model(path)
    body = pinocchio.FrameType.BODY
    if not model.existFrame(tip, body):
        links = ", ".join(frame.name for frame in model.frames if frame.type == body)
        raise InputError(f"{path}: has no link '{tip}'; it has {links}")
    frame = model.getFrameId(tip, body)
    places = [joint for joint in model.supports[model.frames[frame].parentJoint] if joint > 0]
    if not places:
        raise InputError(f"{path}: no joint moves link '{tip}'")
    joints = {model.names[place]: model.joints[place] for place in places}
    for name, joint in joints.items():
        if joint.nv != 1:
            raise InputError(f"{path}: joint '{name}' is not revolute, continuous or prismatic")
        if joint.nq == 1 and _turns(joint):
            check_limits(f"{path}: joint '{name}'", *_limits(model, joint))
    return model, frame, joints


def _turns(joint: Any) -> bool:
    """Whether a joint of Pinocchio's is revolute or continuous."""
    return str(joint.shortname()).startswith("JointModelR")


def _limits(model: Any, joint: Any) -> tuple[float, float]:
    return float(model.lowerPositionLimit[joint.idx_q]), float(model.upperPositionLimit[joint.idx_q])


def _range(model: Any, joint: Any) -> tuple[float, float]:
    """Bounds in rad of a joint; continuous ones and those without limits are seldom wound up."""
    lower, upper = _limits(model, joint)
    return (lower, upper) if joint.nq == 1 and lower < upper else (-WOUND, WOUND)


def _poses(model: Any, frame: int, joints: Sequence[Any], positions: np.ndarray) -> np.ndarray:
    """(T, 7) m and unit quaternions w, x, y, z of a frame at joint positions (T, n) rad or m."""
    import pinocchio

    data, configuration = model.createData(), pinocchio.neutral(model)
    poses = np.empty((len(positions), 7))
    for row, angles in enumerate(positions):
        for joint, angle in zip(joints, angles.tolist(), strict=True):
            if joint.nq == 1:
                configuration[joint.idx_q] = angle
            else:  # continuous joints are represented by cosine and sine
                configuration[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        pinocchio.forwardKinematics(model, data, configuration)
        placement = pinocchio.updateFramePlacement(model, data, frame)
        poses[row, :3] = placement.translation
        poses[row, 3:] = quaternion.from_xyzw(pinocchio.Quaternion(placement.rotation).coeffs())
    poses[:, 3:] = quaternion.sign_continuous(poses[:, 3:])
    return poses
