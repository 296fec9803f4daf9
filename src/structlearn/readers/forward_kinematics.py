"""A pose from joint positions: forward kinematics of a URDF by Pinocchio.

Joints are matched by their names; those that are not between the root and the tip do not matter. The pose is
in the frame of the URDF's root link.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import home_path
from structlearn.readers.clock import linear, shared_stamps
from structlearn.readers.joint_series import JointSeries
from structlearn.readers.recording import Stream
from structlearn.readers.topics import JointPose


def joint_pose(where: str, series: Sequence[JointSeries], pose: JointPose) -> Stream:
    """Stream of the pose of a link, on the clock of the slowest of its joints (`clock.shared_stamps`).

    Raises:
        InputError: the URDF is missing or no URDF, has no such link, or a joint on the way to it is not
            revolute, continuous or prismatic; nothing moves it; the log lacks a joint on the way or its
            position; or its joints are not all there at one time.
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

    Raises:
        InputError: the file is missing, a pipe, no URDF, or a xacro file that is not expanded yet.
    """
    if path.exists() and not path.is_file():  # a pipe would be waited for
        raise InputError(f"{path}: cannot be read: not a file")
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise InputError(f"{path}: no such URDF file: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # of encodings: the latter
        raise InputError(f"{path}: not an XML file: {error}") from error
    if root.tag != "robot":
        raise InputError(f"{path}: not a URDF file: its root is <{root.tag}>, not <robot>")
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
