"""Self-collision: distances between an arm's links, by the collision shapes of its URDF.

Distances are those of the meshes' convex hulls, which is quick and never too large; where hulls come nearer
than a threshold, the meshes themselves decide. Neighbours in the tree touch by design and are no pair, nor
are links whose shapes touch at the rest configuration: these are reported, since they are not checked.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio

from structlearn.core.errors import InputError
from structlearn.rigid_body.inverse_kinematics import Arm
from structlearn.rigid_body.tree import configuration


@dataclass(frozen=True)
class LinkShapes:
    """Shapes of an arm's links, and the pairs of them that are checked."""

    arm: Arm
    meshes: pinocchio.GeometryModel  # as in the URDF
    hulls: pinocchio.GeometryModel  # the same pairs, with meshes replaced by their convex hulls
    pairs: tuple[str, ...]  # (N,) names of the links of each pair, "a and b"
    touching: tuple[str, ...]  # pairs that touch at rest and are not checked
    bare: tuple[str, ...]  # links that move and have no shape


def read_shapes(arm: Arm, locked: Sequence[str], rest: np.ndarray) -> LinkShapes:
    """Read the collision shapes of an arm's URDF, with the same joints locked; rest is a configuration (n,).

    Meshes are searched in the URDF's folder and those above it, and by ROS_PACKAGE_PATH. Raises InputError: a
    mesh is missing or unreadable, or there are fewer than two links with shapes.
    """
    model = pinocchio.buildModelFromUrdf(str(arm.source))
    folder = arm.source.resolve().parent
    try:
        meshes = pinocchio.buildGeomFromUrdf(
            model,
            str(arm.source),
            pinocchio.GeometryType.COLLISION,
            package_dirs=[str(place) for place in (folder, *folder.parents)],
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

    Where hulls come nearer than `near` m, the meshes decide.
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
    """All pairs of shapes whose links are not the same, nor joined by one joint."""
    parents = list(arm.model.parents)
    moved = [shape.parentJoint for shape in shapes.geometryObjects]
    return [
        pinocchio.CollisionPair(one, other)
        for one in range(len(moved))
        for other in range(one + 1, len(moved))
        if moved[one] != moved[other]
        and parents[moved[one]] != moved[other]
        and parents[moved[other]] != moved[one]
    ]


def _drop_touching(arm: Arm, shapes: pinocchio.GeometryModel, rest: np.ndarray) -> tuple[str, ...]:
    """Remove the pairs that touch at rest, and return their names."""
    data, found = arm.model.createData(), pinocchio.GeometryData(shapes)
    pinocchio.computeCollisions(arm.model, data, shapes, found, configuration(arm.model, rest), False)
    touching = [
        pinocchio.CollisionPair(pair.first, pair.second)
        for pair, result in zip(shapes.collisionPairs, found.collisionResults, strict=True)
        if result.isCollision()
    ]
    for pair in touching:
        shapes.removeCollisionPair(pair)
    return tuple(sorted({_names(shapes, pair) for pair in touching}))


def _names(shapes: pinocchio.GeometryModel, pair: pinocchio.CollisionPair) -> str:
    """Names of both links, without Pinocchio's numbers of their shapes."""
    names = [shapes.geometryObjects[place].name.rsplit("_", 1)[0] for place in (pair.first, pair.second)]
    return " and ".join(names)
