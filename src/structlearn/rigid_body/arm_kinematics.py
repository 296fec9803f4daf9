"""Inverse kinematics and self-collision distances of an arm, by Pinocchio.

Inverse kinematics: each sample starts from the previous solution and takes Newton steps on the pose error,
with damping proportional to that error (Sugihara 2011), so the arm approaches and leaves unreachable poses
smoothly. Redundant joints are drawn towards a rest configuration at a bounded rate, so a path has a single
solution, which is smooth where the Jacobian has full rank. Joint limits are not enforced; the caller sees
how far a path exceeds them.

    arm = read_arm("robot.urdf", "tool0")
    path = follow(arm, positions, orientations, dt, rest)    # all poses at once
    follower = Follower(arm, rest, dt)                       # or pose by pose, in a control loop
    joints = follower.start(position, orientation)
    joints = follower.step(position, orientation)

Self-collision: the distance between two links is that of the convex hulls of their collision shapes, which is
fast and never overestimates; below a threshold the meshes themselves are used. Links joined by one joint are
not checked, nor are links whose shapes touch in the rest configuration; the latter are reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.urdf_file import check_numbers, pinocchio_model, robot_element
from structlearn.rigid_body.robot import configuration, read_model, robot_of
from structlearn.rigid_body.tree import KinematicTree
from structlearn.rigid_body.urdf import mesh_folders

CONVERGED = 1e-9  # m and rad; then the third derivative of joints sampled at 5 ms is accurate to 0.01 rad/s^3
DAMPING = 1e-10  # minimum damping, squared: negligible for singular values above 0.001
STEPS, FIRST_STEPS = (12, 300)  # most Newton steps: per sample (two or three are typical), and for the first
LARGEST_STEP = 0.2  # rad or m per joint and Newton step, so that the first pose is approached gradually
TO_REST = 2.0  # 1/s, rate of redundant joints towards rest: slower than a movement of one or two seconds
TRIALS = 50  # random candidates for the rest configuration


@dataclass(frozen=True)
class Arm:
    """An arm with a fixed base, and the frame (tip) whose poses are given."""

    source: Path  # the URDF
    tree: KinematicTree
    model: pinocchio.Model  # with the same joints in the same order
    tip: int  # index of the frame in the model


@dataclass(frozen=True)
class JointPath:
    """Joint path that moves the tip along given poses, with the remaining errors."""

    joints: np.ndarray  # (T, n) rad or m; continuous joints are not wrapped
    missed_m: np.ndarray  # (T,) distance of the tip from the given position
    missed_rad: np.ndarray  # (T,) angle from the given orientation; 0 without one
    jacobian: np.ndarray  # (T, 3 or 6, n) of the tip in base axes: linear, then angular with orientations

    @property
    def least_singular_value(self) -> np.ndarray:
        """(T,) smallest singular value of the Jacobian (m or rad of the tip per rad of the joints)."""
        return np.linalg.svd(self.jacobian, compute_uv=False)[:, -1]


def read_arm(path: str | Path, tip: str, locked: Sequence[str] = ()) -> Arm:
    """Read an arm from its URDF; `tip` is the link or frame whose poses will be given.

    Masses and meshes are not needed; locked joints are held at zero position.

    Raises:
        InputError: as `robot.read_model`, or there is no such tip.
    """
    model = read_model(path, locked)
    if not model.existFrame(tip):
        links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
        raise InputError(f"{path}: there is no link '{tip}'; there are {', '.join(links)}")
    return Arm(Path(path), robot_of(model).tree, model, model.getFrameId(tip))


def follow(
    arm: Arm, position: np.ndarray, orientation: np.ndarray | None, dt: float, rest: np.ndarray
) -> JointPath:
    """Inverse kinematics of a path with one pose every `dt` s.

    Args:
        arm: the arm.
        position: (T, 3) m in the arm's base frame.
        orientation: (T, 4) unit quaternions; None leaves the orientation free.
        dt: sampling interval in s.
        rest: (n,) configuration that redundant joints are drawn towards, and the initial guess.
    """
    turned = orientation is not None
    follower = Follower(arm, rest, dt, turned)
    path = JointPath(
        joints=np.empty((len(position), arm.model.nv)),
        missed_m=np.empty(len(position)),
        missed_rad=np.empty(len(position)),
        jacobian=np.empty((len(position), len(follower.error), arm.model.nv)),
    )
    for sample, point in enumerate(position):
        reach = follower.step if sample else follower.start
        path.joints[sample] = reach(point, None if orientation is None else orientation[sample])
        path.missed_m[sample] = np.linalg.norm(follower.error[:3])
        path.missed_rad[sample] = np.linalg.norm(follower.error[3:])
        path.jacobian[sample] = follower.jacobian
    return path


def rest_for(
    arm: Arm, position: np.ndarray, orientation: np.ndarray | None, dt: float, seed: int
) -> np.ndarray:
    """Configuration (n,) to start a path from, chosen to stay far from joint limits and singularities.

    Maximises the smaller of two minima along the path: the distance to the nearest limit over half the joint
    range, and the least singular value. The path may be sampled coarsely; arguments are those of `follow`.

    Raises InputError: no trial keeps within the joints' limits.
    """
    tree, rng = arm.tree, np.random.default_rng(seed)
    lower, upper = tree.ranges
    half, best, start = 0.5 * (upper - lower), 0.0, None
    for _ in range(TRIALS):
        path = follow(arm, position, orientation, dt, rng.uniform(lower, upper))
        room = np.minimum(path.joints - tree.lower, tree.upper - path.joints) / half
        rated = min(room.min(), path.least_singular_value.min())
        if max(path.missed_m.max(), path.missed_rad.max()) < 1e-6 and rated > best:
            best, start = rated, path.joints[0]
    if start is None:
        raise InputError(
            f"{arm.source}: no configuration within the joints' limits takes the tip from "
            f"{np.array2string(position[0], precision=3)} m along the path ({TRIALS} tried): is the base "
            "where the demonstrations have their origin?"
        )
    return start


class Follower:
    """Inverse kinematics pose by pose, for a path or in a control loop.

    Attributes:
        joints: (n,) rad or m, solution for the latest pose.
        error: (3 or 6,) remaining error in base axes: m, then rad if orientations are tracked.
        jacobian: (3 or 6, n) of the tip at `joints`.
    """

    def __init__(self, arm: Arm, rest: np.ndarray, dt: float, turned: bool = True) -> None:
        """Create a follower; call `start` first. `rest` (n,) and `dt` are those of `follow`."""
        self._arm, self._data, self._rest = arm, arm.model.createData(), np.array(rest, dtype=float)
        self._pull, self._identity = TO_REST * dt, np.eye(arm.model.nv)
        self.joints, self.error = self._rest.copy(), np.zeros(6 if turned else 3)
        self.jacobian = np.zeros((len(self.error), arm.model.nv))

    def start(self, position: np.ndarray, orientation: np.ndarray | None) -> np.ndarray:
        """Joints (n,) for the first pose (3,), (4,), as close to rest as it permits.

        Redundant joints are iterated to convergence, so the path does not start with a null-space motion.
        """
        self.joints = self._rest.copy()
        for _ in range(FIRST_STEPS):
            move = self._newton(position, orientation, 0.5)
            if np.abs(self.error).max() < CONVERGED and np.abs(move).max() < CONVERGED:
                break
            self._take(move)
        return self.joints

    def step(self, position: np.ndarray, orientation: np.ndarray | None) -> np.ndarray:
        """Joints (n,) for the next pose, starting from the previous solution."""
        self._take(self._newton(position, orientation, self._pull))
        for _ in range(STEPS):
            move = self._newton(position, orientation, 0.0)
            if np.abs(self.error).max() < CONVERGED:
                break
            self._take(move)
        return self.joints

    def _newton(self, position: np.ndarray, orientation: np.ndarray | None, pull: float) -> np.ndarray:
        """Newton step (n,) towards a pose, plus a null-space step of `pull` times the way to rest."""
        arm, data = self._arm, self._data
        pinocchio.computeJointJacobians(arm.model, data, configuration(arm.model, self.joints))
        frame = pinocchio.updateFramePlacement(arm.model, data, arm.tip)
        axes = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pinocchio.getFrameJacobian(arm.model, data, arm.tip, axes)
        self.jacobian = jacobian.reshape(6, -1)[: len(self.error)]  # a vector for a single joint
        self.error[:3] = position - frame.translation
        if len(self.error) == 6 and orientation is not None:
            self.error[3:] = pinocchio.log3(quaternion.matrix(orientation) @ frame.rotation.T)
        damped = self.jacobian @ self.jacobian.T
        damped[np.diag_indices(len(damped))] += 0.5 * (self.error @ self.error) + DAMPING
        inverse = np.linalg.solve(damped, self.jacobian).T  # (n, 3 or 6)
        move = inverse @ self.error
        if pull:
            move = move + pull * (self._identity - inverse @ self.jacobian) @ (self._rest - self.joints)
        return move

    def _take(self, move: np.ndarray) -> None:
        self.joints = self.joints + move * min(1.0, LARGEST_STEP / max(np.abs(move).max(), LARGEST_STEP))


@dataclass(frozen=True)
class LinkShapes:
    """Collision shapes of an arm's links, and the pairs that are checked."""

    arm: Arm
    meshes: pinocchio.GeometryModel  # as in the URDF
    hulls: pinocchio.GeometryModel  # the same pairs, with meshes replaced by their convex hulls
    pairs: tuple[str, ...]  # (N,) link names of each pair, "a and b"
    touching: tuple[str, ...]  # pairs that touch at rest and are not checked
    bare: tuple[str, ...]  # moving links without a shape


def read_collision_shapes(arm: Arm, locked: Sequence[str], rest: np.ndarray) -> LinkShapes:
    """Read an arm's collision shapes from its URDF, with the same joints locked; `rest` is (n,) rad or m.

    Meshes are searched for in `urdf.mesh_folders`.

    Raises InputError: a mesh is missing or unreadable, a value is not a number, or fewer than two links have
    shapes.
    """
    for link in robot_element(arm.source).findall("link"):
        for shape in link.findall("collision"):
            check_numbers(shape, f"{arm.source}: link '{link.get('name')}'")
    model = pinocchio_model(arm.source)
    try:
        meshes = pinocchio.buildGeomFromUrdf(
            model,
            str(arm.source),
            pinocchio.GeometryType.COLLISION,
            package_dirs=[str(place) for place in mesh_folders(arm.source)],
        )
    except (ValueError, RuntimeError) as error:
        raise InputError(f"{arm.source}: collision shapes cannot be read: {error}") from error
    joints = [model.getJointId(name) for name in locked]
    if joints:
        _, meshes = pinocchio.buildReducedModel(model, meshes, joints, pinocchio.neutral(model))
    shaped = {shape.parentJoint for shape in meshes.geometryObjects}
    if len(shaped) < 2:
        raise InputError(f"{arm.source}: fewer than two links have collision shapes")
    for pair in _distant_pairs(arm, meshes):
        meshes.addCollisionPair(pair)
    touching = _drop_touching(arm, meshes, rest)
    hulls = meshes.copy()
    for shape in hulls.geometryObjects:
        if hasattr(shape.geometry, "buildConvexRepresentation"):  # a mesh
            shape.geometry.buildConvexRepresentation(True)
            shape.geometry = shape.geometry.convex
    names = tuple(_names(meshes, pair) for pair in meshes.collisionPairs)
    bare = [name for number, name in enumerate(arm.tree.names, start=1) if number not in shaped]
    return LinkShapes(arm, meshes, hulls, names, touching, tuple(bare))


def link_distances(shapes: LinkShapes, joints: np.ndarray, near: float) -> np.ndarray:
    """Distance of each pair along a path: (T, n) joints -> (T, N) m, negative or 0 where links touch.

    Pairs whose hulls are closer than `near` m are measured on the meshes.
    """
    arm, data = shapes.arm, shapes.arm.model.createData()
    hulls, meshes = pinocchio.GeometryData(shapes.hulls), pinocchio.GeometryData(shapes.meshes)
    distances = np.empty((len(joints), len(shapes.pairs)))
    for sample, row in enumerate(joints):
        pinocchio.computeDistances(arm.model, data, shapes.hulls, hulls, configuration(arm.model, row))
        distances[sample] = [result.min_distance for result in hulls.distanceResults]
        suspected = np.flatnonzero(distances[sample] < near)
        if len(suspected):
            pinocchio.updateGeometryPlacements(arm.model, data, shapes.meshes, meshes)
        for pair in suspected:
            distance = pinocchio.computeDistance(shapes.meshes, meshes, int(pair)).min_distance
            distances[sample, pair] = max(distance, distances[sample, pair])
    return distances


def _distant_pairs(arm: Arm, shapes: pinocchio.GeometryModel) -> list[pinocchio.CollisionPair]:
    """All pairs of shapes on different links that no joint connects directly."""
    parents = list(arm.model.parents)
    moved = [shape.parentJoint for shape in shapes.geometryObjects]
    return [
        pinocchio.CollisionPair(first, second)
        for first in range(len(moved))
        for second in range(first + 1, len(moved))
        if moved[first] != moved[second]
        and parents[moved[first]] != moved[second]
        and parents[moved[second]] != moved[first]
    ]


def _drop_touching(arm: Arm, shapes: pinocchio.GeometryModel, rest: np.ndarray) -> tuple[str, ...]:
    """Remove the pairs that touch at rest, and return their names."""
    data, geometry = arm.model.createData(), pinocchio.GeometryData(shapes)
    pinocchio.computeCollisions(arm.model, data, shapes, geometry, configuration(arm.model, rest), False)
    touching = [
        pinocchio.CollisionPair(pair.first, pair.second)
        for pair, result in zip(shapes.collisionPairs, geometry.collisionResults, strict=True)
        if result.isCollision()
    ]
    for pair in touching:
        shapes.removeCollisionPair(pair)
    return tuple(sorted({_names(shapes, pair) for pair in touching}))


def _names(shapes: pinocchio.GeometryModel, pair: pinocchio.CollisionPair) -> str:
    """Names of both links, without the shape index that Pinocchio appends."""
    names = [shapes.geometryObjects[place].name.rsplit("_", 1)[0] for place in (pair.first, pair.second)]
    return " and ".join(names)
