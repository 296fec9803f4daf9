"""Inverse kinematics along a path: joints that carry a frame of the arm through given poses.

Pinocchio gives frames and Jacobians; each sample is solved from the one before by Newton steps on the pose,
damped as far as the pose is missed (Sugihara 2011), so that a pose out of reach is approached and left again
without a fling. What the pose leaves free (a seventh joint, an orientation that nobody asked for) is drawn
towards a rest configuration at a bounded pace, so a path has one answer, and a smooth one where the
Jacobian has full rank. Joint limits are not enforced: whoever asks sees how far a path goes beyond them.

    arm = read_arm("robot.urdf", "tool0")
    path = follow(arm, positions, orientations, dt, rest)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.rigid_body.tree import KinematicTree, read_model, robot_of

CONVERGED = 1e-9
"""m and rad; a third difference of joints at 5 ms, divided by the time, is known to 0.01 rad/s^3 then."""

DAMPING = 1e-10
"""Square of the least damping: without effect where singular values are above 0.001."""

STEPS, FIRST_STEPS = 12, 300
"""Newton steps per sample, of which two or three are needed, and for the first one, which may be far away."""

LARGEST_STEP = 0.2
"""rad or m that a joint moves in one Newton step, so that the first pose is approached, not leapt at."""

TO_REST = 2.0
"""1/s: how fast free joints go towards the rest configuration, slower than a movement of a second or two."""

TRIALS = 50
"""Random configurations from which a rest configuration is looked for."""


@dataclass(frozen=True)
class Arm:
    """A robot with a fixed base, and the frame that is to be carried along.

    Attributes:
        source: its URDF.
        tree: names and limits of its n joints.
        model: Pinocchio's, with the same joints in the same order.
        tip: the frame's number in the model.
    """

    source: Path
    tree: KinematicTree
    model: pinocchio.Model
    tip: int

    def configuration(self, joints: np.ndarray) -> np.ndarray:
        """Pinocchio's configuration of joints (n,): continuous ones are a cosine and a sine there."""
        return pinocchio.integrate(self.model, pinocchio.neutral(self.model), joints)


@dataclass(frozen=True)
class JointPath:
    """What carries the tip along a path of T samples; n joints.

    Attributes:
        joints: (T, n) rad or m; turns of continuous joints are counted.
        missed_m: (T,) distance of the tip from where it should be.
        missed_rad: (T,) angle from how it should stand; 0 where no orientation is asked for.
        jacobian: (T, 3 or 6, n) of the tip in base axes: linear, then angular part where it is asked for.
    """

    joints: np.ndarray
    missed_m: np.ndarray
    missed_rad: np.ndarray
    jacobian: np.ndarray

    @property
    def least_singular_value(self) -> np.ndarray:
        """(T,) smallest singular value of the Jacobian (m or rad of the tip per rad of the joints)."""
        return np.linalg.svd(self.jacobian, compute_uv=False)[:, -1]


def read_arm(path: str | Path, tip: str, locked: Sequence[str] = ()) -> Arm:
    """Read an arm from its URDF; masses and meshes are not needed.

    Args:
        path: the URDF file.
        tip: the link, or other frame, whose poses are given.
        locked: names of joints held at zero position.

    Raises:
        InputError: see `tree.read_model`; or there is no such tip.
    """
    model = read_model(path, locked)
    if not model.existFrame(tip):
        links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
        raise InputError(f"{path}: there is no link '{tip}'; there are {', '.join(links)}")
    return Arm(Path(path), robot_of(model).tree, model, model.getFrameId(tip))


def tip_poses(arm: Arm, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where joints bring the tip: (T, n) -> (T, 3) m and (T, 4) unit quaternions."""
    data = arm.model.createData()
    position, rotation = np.empty((len(joints), 3)), np.empty((len(joints), 4))
    for place, row in enumerate(joints):
        pinocchio.forwardKinematics(arm.model, data, arm.configuration(row))
        frame = pinocchio.updateFramePlacement(arm.model, data, arm.tip)
        position[place] = frame.translation
        rotation[place] = pinocchio.Quaternion(frame.rotation).coeffs()
    return position, quaternion.from_xyzw(rotation)


def follow(
    arm: Arm,
    position: np.ndarray,
    orientation: np.ndarray | None,
    dt: float,
    rest: np.ndarray,
) -> JointPath:
    """Joints that carry the tip along a path.

    Args:
        arm: the arm.
        position: (T, 3) m in the arm's base frame.
        orientation: (T, 4) unit quaternions, or None where the tip may stand as it likes.
        dt: sampling interval in s.
        rest: (n,) towards which free joints are drawn; the first pose is sought from there.
    """
    solver = _Solver(arm, orientation is not None)
    rotation = [np.eye(3)] * len(position) if orientation is None else map(quaternion.matrix, orientation)
    path = JointPath(
        joints=np.empty((len(position), arm.model.nv)),
        missed_m=np.empty(len(position)),
        missed_rad=np.empty(len(position)),
        jacobian=np.empty((len(position), solver.rows, arm.model.nv)),
    )
    joints = np.array(rest, dtype=float)
    for sample, wanted in enumerate(zip(position, rotation, strict=True)):
        if sample == 0:
            joints = solver.solve(*wanted, joints, rest, pull=1.0, steps=FIRST_STEPS)
        else:
            joints = solver.solve(*wanted, joints, rest, pull=TO_REST * dt, steps=STEPS)
        path.joints[sample] = joints
        path.missed_m[sample] = np.linalg.norm(solver.error[:3])
        path.missed_rad[sample] = np.linalg.norm(solver.error[3:])
        path.jacobian[sample] = solver.jacobian
    return path


def rest_for(arm: Arm, position: np.ndarray, orientation: np.ndarray | None, seed: int) -> np.ndarray:
    """A configuration (n,) with the tip at a pose, of several the one farthest from limits and singularities.

    Each is rated by the smaller of two: its distance from the nearest limit over half the range, and the
    least singular value.

    Args:
        arm: the arm.
        position: (3,) m.
        orientation: (4,) unit quaternion, or None.
        seed: of the configurations from which the search starts.

    Raises:
        InputError: none was found within the joints' limits.
    """
    tree, rng = arm.tree, np.random.default_rng(seed)
    lower = np.where(np.isfinite(tree.lower), tree.lower, -np.pi)
    upper = np.where(np.isfinite(tree.upper), tree.upper, np.pi)
    half, best, found = 0.5 * (upper - lower), 0.0, None
    turned = None if orientation is None else orientation[None]
    for _ in range(TRIALS):
        path = follow(arm, position[None], turned, 1.0, rng.uniform(lower, upper))
        room = np.minimum(path.joints[0] - tree.lower, tree.upper - path.joints[0]) / half
        rated = min(room.min(), path.least_singular_value[0])
        if path.missed_m[0] < 1e-6 and path.missed_rad[0] < 1e-6 and rated > best:
            best, found = rated, path.joints[0]
    if found is None:
        raise InputError(
            f"{arm.source}: no configuration within the joints' limits brings the tip to "
            f"{np.array2string(position, precision=3)} m at the orientation of the start "
            f"({TRIALS} tried): is the base where the demonstrations have their origin?"
        )
    return found


class _Solver:
    """Newton steps to poses, with the memory that they need.

    Attributes:
        rows: 3 for positions, 6 with orientations.
        error: (rows,) what is left, linear then angular, base axes.
        jacobian: (rows, n) there.
    """

    def __init__(self, arm: Arm, turned: bool) -> None:
        self._arm, self._data = arm, arm.model.createData()
        self.rows = 6 if turned else 3
        self.error, self.jacobian = np.zeros(self.rows), np.zeros((self.rows, arm.model.nv))

    def solve(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        joints: np.ndarray,
        rest: np.ndarray,
        pull: float,
        steps: int,
    ) -> np.ndarray:
        """Joints (n,) for a pose (3,), (3, 3), from joints nearby.

        Args:
            position: m.
            rotation: of the tip's frame; not looked at for positions alone.
            joints: (n,) to start from.
            rest: (n,) towards which free joints go.
            pull: part of the way to `rest` that they go in the first step; 1: as near as they can.
            steps: at most.
        """
        identity = np.eye(self._arm.model.nv)
        self._look(joints, position, rotation)
        for step in range(steps):
            missed = self.error @ self.error
            damped = self.jacobian @ self.jacobian.T
            damped[np.diag_indices(self.rows)] += 0.5 * missed + DAMPING
            inverse = np.linalg.solve(damped, self.jacobian).T  # (n, rows)
            move = inverse @ self.error
            settles = pull == 1.0  # the first pose: free joints come to rest too
            if step == 0 or settles:
                free = (identity - inverse @ self.jacobian) @ (rest - joints)
                move = move + (0.5 if settles else pull) * free
            largest = np.abs(move).max()
            joints = joints + move * min(1.0, LARGEST_STEP / max(largest, LARGEST_STEP))
            self._look(joints, position, rotation)
            if np.abs(self.error).max() < CONVERGED and (not settles or largest < CONVERGED):
                break
        return joints

    def _look(self, joints: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> None:
        """Bring error and Jacobian to these joints."""
        arm, data = self._arm, self._data
        pinocchio.computeJointJacobians(arm.model, data, arm.configuration(joints))
        frame = pinocchio.updateFramePlacement(arm.model, data, arm.tip)
        axes = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        self.jacobian = pinocchio.getFrameJacobian(arm.model, data, arm.tip, axes)[: self.rows]
        self.error[:3] = position - frame.translation
        if self.rows == 6:
            self.error[3:] = pinocchio.log3(rotation @ frame.rotation.T)
