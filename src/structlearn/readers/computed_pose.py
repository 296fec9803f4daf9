"""A pose that no topic has: from /tf, or from joint positions by the robot's kinematics.

Each transform on /tf is a stream of its own: the pose of a child frame in its parent's. Transforms at rest,
those on the static topic and those that never change, have no clock. The others are put together on that of
the slowest (`clock.shared_stamps`): positions are interpolated linearly, orientations by slerp.

Of a URDF, Pinocchio computes the pose of a link in the frame of the root. Joints are matched by their names;
those that are not between the root and the tip do not matter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import home_path
from structlearn.core.reading import require_file
from structlearn.readers.bag import RawMessages
from structlearn.readers.cdr import decoded, fields_named, nanoseconds, sample_stamps
from structlearn.readers.clock import StampPolicy, in_order, linear, shared_stamps, slerp
from structlearn.readers.joint_log import MOST_JOINTS, JointSeries
from structlearn.readers.recording import NORM_TOLERANCE, Stream
from structlearn.readers.topics import JointPose, TransformPose

Edge = tuple[str, str]
"""Parent and child frame."""


@dataclass(frozen=True)
class TransformSeries:
    """One transform as it came: the child's pose in the parent's frame."""

    parent: str
    child: str
    stamps: np.ndarray  # (T,) int64 ns in the order in which they came
    values: np.ndarray  # (T, 7) m, then unit quaternion w, x, y, z

    @property
    def moves(self) -> bool:
        """Whether it ever changes."""
        return bool((self.values != self.values[0]).any())


def transform_series(where: str, messages: RawMessages, policy: StampPolicy) -> dict[Edge, TransformSeries]:
    """Every transform on a topic in the order in which they came; frames without the slash of ROS 1.

    Raises InputError: a message cannot be decoded or lacks a field of its type, or a quaternion is not of
    unit norm; frames are named.
    """
    pieces: dict[Edge, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {}
    with fields_named(where):
        for group in decoded(where, messages):
            for one in group.message.transforms:
                edge = one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")
                stamps = np.atleast_1d(nanoseconds(one.header.stamp))
                pieces.setdefault(edge, []).append((group.rows, stamps, _values(one.transform)))
    series = {}
    for (parent, child), its in pieces.items():
        rows, stamps, values = (np.concatenate(parts) for parts in zip(*its, strict=True))
        order = np.argsort(rows, kind="stable")
        values = values[order]
        norms = np.linalg.norm(values[:, 3:], axis=1)
        if (np.abs(norms - 1.0) > NORM_TOLERANCE).any():
            norm = norms[np.argmax(np.abs(norms - 1.0))]
            raise InputError(
                f"{where}: transform from '{parent}' to '{child}': quaternion has norm {norm:.6g}, not 1"
            )
        stamps = sample_stamps(messages.log_times[rows[order]], stamps[order], policy)
        series[parent, child] = TransformSeries(parent, child, stamps, values)
    return series


def chain(where: str, edges: Sequence[Edge], parent: str, child: str) -> list[Edge]:
    """The transforms on the way from one frame to another, in its order; either may be above the other.

    Raises InputError: a frame is in none of them, none leads on, or a frame on the way has two parents.
    """
    parent, child = parent.lstrip("/"), child.lstrip("/")
    frames = sorted({frame for edge in edges for frame in edge})
    for frame in (parent, child):
        if frame not in frames:
            raise InputError(f"{where}: has no frame '{frame}'; it has {', '.join(frames) or 'none'}")
    way: dict[str, list[Edge]] = {parent: []}
    waiting = [parent]
    while waiting and child not in way:
        frame = waiting.pop(0)
        for edge in edges:
            for here, there in (edge, edge[::-1]):
                if here == frame and there not in way:
                    way[there] = [*way[frame], edge]
                    waiting.append(there)
    if child not in way:
        reached = ", ".join(sorted(way))
        raise InputError(f"{where}: no transforms lead from '{parent}' to '{child}', only to {reached}")
    for _, below in way[child]:
        above = sorted(one for one, other in edges if other == below)
        if len(above) > 1:
            raise InputError(f"{where}: frame '{below}' has several parents: {', '.join(above)}")
    return way[child]


def transform_pose(
    where: str, messages: Mapping[str, RawMessages], pose: TransformPose, policy: StampPolicy
) -> tuple[Stream, str | None]:
    """Stream of the pose of one frame in another, and what was done about stamps of its transforms.

    `messages` are those of each of `pose.topics` that the file has. Raises InputError: as `transform_series`
    and `chain`; stamps of a transform do not increase; nothing on the way moves; or what moves is not all
    there at one time.
    """
    series: dict[Edge, TransformSeries] = {}
    moving: set[Edge] = set()
    for topic in reversed(pose.topics):  # what is on both is not at rest
        if topic in messages:
            its = transform_series(f"{where}: topic '{topic}'", messages[topic], policy)
            series |= its
            if topic == pose.topic:
                moving = {edge for edge, one in its.items() if one.moves}
    where = f"{where}: topic '{pose.topic}'"
    way = chain(where, list(series), pose.parent, pose.child)
    if not moving.intersection(way):
        raise InputError(f"{where}: '{pose.child}' does not move in '{pose.parent}'")
    notes = []
    for edge in way:
        if edge in moving:
            whole = series[edge]
            name = f"transform from '{edge[0]}' to '{edge[1]}'"
            rows, note = in_order(f"{where}: {name}", whole.stamps, policy)
            if note is not None:
                notes.append(f"{note} of {name}")
                series[edge] = TransformSeries(*edge, whole.stamps[rows], whole.values[rows])
    ticks = shared_stamps([series[edge].stamps for edge in way if edge in moving])
    if len(ticks) < 2:
        names = ", ".join(f"'{above}' to '{below}'" for above, below in way if (above, below) in moving)
        raise InputError(f"{where}: the transforms {names} are not there at one time")
    frame = pose.parent.lstrip("/")
    values = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(ticks), 1))
    for edge in way:
        one = series[edge]
        step = _sampled(one, ticks) if edge in moving else np.tile(one.values[-1], (len(ticks), 1))
        forwards = edge[0] == frame
        frame = edge[1] if forwards else edge[0]
        values = _composed(values, step if forwards else _inverse(step))
    values[:, 3:] = quaternion.sign_continuous(quaternion.normalised(values[:, 3:]))
    return Stream(pose.topic, "pose", ticks, values), ", ".join(notes) or None


def _values(transform: Any) -> np.ndarray:
    """(M, 7) of a message's transform, whose numbers may be columns."""
    p, q = transform.translation, transform.rotation
    return np.stack([np.atleast_1d(value) for value in (p.x, p.y, p.z, q.w, q.x, q.y, q.z)], axis=1)


def _sampled(series: TransformSeries, ticks: np.ndarray) -> np.ndarray:
    """(M, 7) of a transform at (M,) ns."""
    start = ticks[0]
    at, stamps = (ticks - start).astype(float), (series.stamps - start).astype(float)
    return np.hstack([linear(at, stamps, series.values[:, :3]), slerp(at, stamps, series.values[:, 3:])])


def _composed(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(M, 7) poses of what has the second pose in a frame that has the first."""
    position = first[:, :3] + quaternion.rotate(first[:, 3:], second[:, :3])
    return np.hstack([position, quaternion.product(first[:, 3:], second[:, 3:])])


def _inverse(values: np.ndarray) -> np.ndarray:
    """(M, 7) the parent's pose in the child's frame."""
    turned = quaternion.conjugate(values[:, 3:])
    return np.hstack([-quaternion.rotate(turned, values[:, :3]), turned])


def joint_pose(where: str, series: Sequence[JointSeries], pose: JointPose) -> Stream:
    """Stream of the pose of a link, on the clock of the slowest of its joints (`clock.shared_stamps`).

    Raises InputError: the URDF is missing or no URDF, has no such link, or a joint on the way to it is not
    revolute, continuous or prismatic; nothing moves it; the log lacks a joint on the way or its position; or
    its joints are not all there at one time.
    """
    chain = _Chain(pose)
    its = [one for one in (part.of_joints(chain.names) for part in series) if one is not None]
    present = [name for one in its for name in one.names]
    missing = [name for name in chain.names if name not in present]
    if missing:
        logged = ", ".join(name for one in series for name in one.names)
        raise InputError(
            f"{where}: lacks the joints {', '.join(missing)}, which move '{pose.tip}' in {pose.urdf}; it has "
            f"{logged or 'no names'}"
        )
    unmeasured = [name for one in its if "joint_positions" not in one.values for name in one.names]
    if unmeasured:
        raise InputError(f"{where}: has no positions of the joints {', '.join(unmeasured)}")
    ticks = shared_stamps([one.stamps for one in its])
    if len(ticks) < 2:
        raise InputError(f"{where}: the joints {', '.join(present)} are not there at one time")
    columns: dict[str, np.ndarray] = {}
    for one in its:
        at, stamps = (ticks - ticks[0]).astype(float), (one.stamps - ticks[0]).astype(float)
        sampled = linear(at, stamps, one.values["joint_positions"])
        columns |= dict(zip(one.names, sampled.T, strict=True))
    positions = np.stack([columns[name] for name in chain.names], axis=1)
    return Stream(pose.topic, "pose", ticks, chain.poses(positions))


class _Chain:
    """The joints between a robot's root and a link; `names` (n,) from the root on."""

    def __init__(self, pose: JointPose) -> None:
        import pinocchio  # half a second, which only those who need it wait for

        path = home_path(pose.urdf)
        self._model = _model(path)
        body = pinocchio.FrameType.BODY
        if not self._model.existFrame(pose.tip, body):
            links = ", ".join(frame.name for frame in self._model.frames if frame.type == body)
            raise InputError(f"{path}: has no link '{pose.tip}'; it has {links}")
        self._frame = self._model.getFrameId(pose.tip, body)
        carrying = self._model.frames[self._frame].parentJoint
        places = [joint for joint in self._model.supports[carrying] if joint > 0]
        if not places:
            raise InputError(f"{path}: no joint moves link '{pose.tip}'")
        self.names = [self._model.names[place] for place in places]
        self._joints = [self._model.joints[place] for place in places]
        for name, joint in zip(self.names, self._joints, strict=True):
            if joint.nv != 1:
                raise InputError(f"{path}: joint '{name}' is not revolute, continuous or prismatic")

    def poses(self, positions: np.ndarray) -> np.ndarray:
        """(T, 7) m and unit quaternions w, x, y, z of the link at joint positions (T, n) rad or m."""
        import pinocchio

        data = self._model.createData()
        configuration = pinocchio.neutral(self._model)
        poses = np.empty((len(positions), 7))
        for row, angles in enumerate(positions):
            for joint, angle in zip(self._joints, angles.tolist(), strict=True):
                if joint.nq == 1:
                    configuration[joint.idx_q] = angle
                else:  # a joint that turns without end has its cosine and sine there
                    configuration[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            pinocchio.forwardKinematics(self._model, data, configuration)
            placement = pinocchio.updateFramePlacement(self._model, data, self._frame)
            poses[row, :3] = placement.translation
            poses[row, 3:] = quaternion.from_xyzw(pinocchio.Quaternion(placement.rotation).coeffs())
        poses[:, 3:] = quaternion.sign_continuous(poses[:, 3:])
        return poses


def robot_element(path: Path) -> ElementTree.Element:
    """The root of a URDF.

    Raises InputError: the file is missing, a pipe, no URDF, or a xacro file that is not expanded yet.
    """
    try:
        require_file(path)
        root = ElementTree.parse(path).getroot()
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: no such URDF file: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # of encodings: the latter
        raise InputError(f"{path}: not an XML file: {error}") from error
    if root.tag != "robot":
        raise InputError(f"{path}: not a URDF file: its root is <{root.tag}>, not <robot>")
    if (count := len(root.findall("joint"))) > MOST_JOINTS:
        raise InputError(f"{path}: has {count} joints, more than {MOST_JOINTS}")
    for element in root.iter():
        if isinstance(element.tag, str) and "xacro" in element.tag:
            raise InputError(f"{path}: has <{element.tag}>: expand it first: xacro FILE > robot.urdf")
    return root


def _model(path: Path) -> Any:
    """Pinocchio's model; it prints what is wrong with a file rather than saying it."""
    import pinocchio

    robot_element(path)
    try:
        return pinocchio.buildModelFromUrdf(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a valid URDF model; its parser has printed why") from error
