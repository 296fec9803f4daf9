"""Obstacles of known geometry: sphere, cube and cylinder as in the recorded experiment (IV.8.3).

Sizes were measured on the public motion-capture models of the recorded objects, with the points that augment
their markers (`clmc/obs_avoid/vicon_objects`); the files are not read. Unrolls use obstacles as point clouds,
one per scenario, at rest or moving.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Literal, Self

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import NamedShape

Shape = Literal["sphere", "cube", "cylinder"]
SHAPES: tuple[Shape, ...] = ("sphere", "cube", "cylinder")

HALF_SIZE_M: dict[Shape, tuple[float, float, float]] = {
    # 30 points lie 61.0 +- 0.2 mm from the 31st, their centre.
    "sphere": (0.0610, 0.0610, 0.0610),
    # Four markers are the corners of the top, with sides of 66 to 81 mm, 73 mm on average; the points reach
    # 60.5 mm down: not quite a cube.
    "cube": (0.0366, 0.0366, 0.0303),
    # Five markers form the top ring, 24.7 mm from their centre on average; the points reach 185 mm down.
    "cylinder": (0.0247, 0.0247, 0.0925),
}
"""Half extents along the object's own axes; a cylinder stands along its z axis."""

CLOUD_COUNT = 100
"""Points of a surface cloud: about 2 cm apart, so that the three closest ones face the hand."""

GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
PLASTIC = 1.324717957244746
"""Root of x^3 = x + 1: multiples of (1 / x, 1 / x^2) modulo 1 fill a square evenly."""

RINGS, RING_POINTS = 4, 8
"""Points of the unseen spheres: rings at equal angles between two poles, and the centre."""


@dataclass(frozen=True)
class Obstacle:
    """A solid at rest."""

    shape: Shape
    centre: np.ndarray  # (3,) m
    half_size: np.ndarray  # (3,) m, half extents along the object's own axes
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))  # (3, 3) object to world

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise InputError(f"unknown obstacle '{self.shape}'; known are {', '.join(SHAPES)}")
        size = np.asarray(self.half_size, dtype=float)
        if size.shape != (3,) or not (np.isfinite(size).all() and (size > 0).all()):
            raise InputError(
                f"{self.shape}: half_size must be three positive lengths in m, is {size.tolist()}"
            )
        if (self.shape != "cube" and size[0] != size[1]) or (self.shape == "sphere" and size[0] != size[2]):
            raise InputError(f"{self.shape}: is not round with half_size {size.tolist()}")
        if not np.isfinite(self.centre).all():
            raise InputError(f"{self.shape}: centre must be finite, is {np.asarray(self.centre).tolist()}")

    def signed_distance(self, points: np.ndarray) -> np.ndarray:
        """Distance (...) m of points (..., 3) m to the surface, negative inside."""
        return self.distance_and_normal(points)[0]

    def distance_and_normal(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (...) m, negative inside, of points (..., 3) m, and its gradient (..., 3).

        Both are closed-form. If several points of the surface are equally close, one of them is used.
        """
        own = (np.asarray(points, dtype=float) - self.centre) @ self.rotation
        measure = {"sphere": _sphere, "cube": _cube, "cylinder": _cylinder}[self.shape]
        distance, normal = measure(own, np.asarray(self.half_size, dtype=float))
        return distance, normal @ self.rotation.T

    def cloud(self, count: int = CLOUD_COUNT) -> np.ndarray:
        """Evenly spread points of the surface (count, 3) m, deterministic. Raises ValueError: under six."""
        if count < 6:
            raise ValueError(f"{self.shape}: a surface needs at least 6 points, not {count}")
        points = _cube_cloud(self.half_size, count) if self.shape == "cube" else _spiral(self, count)
        return self.centre + points @ self.rotation.T

    @property
    def radius(self) -> float:
        """Virtual radius in m: mean distance of the surface cloud from its mean."""
        return float(virtual_radius(self.cloud()))


def obstacle(shape: Shape, centre: np.ndarray, yaw: float = 0.0) -> Obstacle:
    """Upright obstacle of the recorded size, with centre (3,) in m, rotated by a yaw in rad.

    Raises InputError: there is no such shape.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    size = np.array(HALF_SIZE_M.get(shape, ()))
    return Obstacle(shape, np.asarray(centre, dtype=float), size, rotation)


def recorded_obstacle(shape: NamedShape) -> Obstacle:
    """Obstacle from a recorded shape. Raises InputError: its size does not fit its form."""
    half = 0.5 * np.asarray(shape.size, dtype=float)
    return Obstacle(shape.form, shape.position, half, quaternion.matrix(shape.orientation))


def virtual_radius(cloud: np.ndarray) -> np.ndarray | float:
    """Mean distance (...) m of a cloud's points (..., P, 3) from their mean. Raises ValueError: empty."""
    check_cloud(cloud)
    return np.linalg.norm(cloud - cloud.mean(axis=-2, keepdims=True), axis=-1).mean(axis=-1)


def check_cloud(cloud: np.ndarray) -> None:
    """Raise ValueError unless a cloud is (..., P, 3) finite points with P >= 1."""
    if np.ndim(cloud) < 2 or np.shape(cloud)[-1] != 3:
        raise ValueError(f"a cloud must be (..., points, 3), has the shape {np.shape(cloud)}")
    if np.shape(cloud)[-2] == 0:
        raise ValueError("an obstacle's cloud has no points")
    if not np.isfinite(cloud).all():
        raise ValueError("an obstacle's cloud has points that are not finite")


def ringed_sphere(centre: np.ndarray, radius: float) -> np.ndarray:
    """Cloud (..., 35, 3) m of the dissertation's unseen spheres: four rings, two poles, the centre last.

    `centre` (..., 3) m, also the mean of the points; `radius`: m.
    """
    polar = np.pi * np.arange(1, RINGS + 1) / (RINGS + 1)
    azimuth = 2.0 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    across = [np.outer(np.sin(polar), turned(azimuth)).ravel() for turned in (np.cos, np.sin)]
    rings = np.stack([*across, np.repeat(np.cos(polar), RING_POINTS)], axis=1)
    unit = np.vstack([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]])
    return np.asarray(centre, dtype=float)[..., None, :] + radius * unit


def _sphere(points: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    length = np.linalg.norm(points, axis=-1)
    return length - half[0], _unit(points, length)


def _cube(points: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    beyond = np.abs(points) - half  # (..., 3), positive outside the pair of faces
    sign = np.where(points < 0.0, -1.0, 1.0)
    outside = np.maximum(beyond, 0.0)
    length = np.linalg.norm(outside, axis=-1)
    face = np.argmax(beyond, axis=-1)[..., None] == np.arange(3)  # the closest face, for points inside
    normal = np.where(length[..., None] > 0.0, _unit(outside, length), face)
    return length + np.minimum(beyond.max(axis=-1), 0.0), sign * normal


def _cylinder(points: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    radial = np.linalg.norm(points[..., :2], axis=-1)
    beyond = np.stack([radial, np.abs(points[..., 2])], axis=-1) - half[[0, 2]]  # (..., 2): mantle, caps
    outside = np.maximum(beyond, 0.0)
    length = np.linalg.norm(outside, axis=-1)
    nearest = np.argmax(beyond, axis=-1)[..., None] == np.arange(2)
    share = np.where(length[..., None] > 0.0, _unit(outside, length), nearest)
    across = _unit(points[..., :2], radial) * share[..., :1]
    along = np.where(points[..., 2:] < 0.0, -1.0, 1.0) * share[..., 1:]
    return length + np.minimum(beyond.max(axis=-1), 0.0), np.concatenate([across, along], axis=-1)


def _unit(vectors: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Vectors (..., D) over their lengths (...); zero vectors become the first axis."""
    some = length[..., None] > 0.0
    first = np.arange(vectors.shape[-1]) == 0
    return np.where(some, vectors / np.where(some, length[..., None], 1.0), first)


def _spiral(solid: Obstacle, count: int) -> np.ndarray:
    """Fibonacci spiral (count, 3) on a solid of revolution about z, from bottom to top in equal areas."""
    radius, _, height = solid.half_size
    share = (np.arange(count) + 0.5) / count
    if solid.shape == "sphere":
        z = height * (2.0 * share - 1.0)
        across = np.sqrt(radius**2 - z**2)
    else:
        mantle = 2.0 * height / (2.0 * height + radius)  # share of the area; each cap has half of the rest
        cap = 0.5 * (1.0 - mantle)
        z = height * np.clip(2.0 * (share - cap) / mantle - 1.0, -1.0, 1.0)
        across = radius * np.sqrt(np.minimum(np.minimum(share, 1.0 - share) / cap, 1.0))
    angle = GOLDEN_ANGLE * np.arange(count)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def _cube_cloud(half: np.ndarray, count: int) -> np.ndarray:
    """Points on the six faces, in proportion to their areas, (count, 3)."""
    areas = np.repeat(np.prod(half) / half, 2)  # faces -x, +x, -y, +y, -z, +z
    ends = np.round(count * np.cumsum(areas) / areas.sum()).astype(int)
    points = []
    for face, number in enumerate(np.diff(ends, prepend=0)):
        axis, others = face // 2, [other for other in range(3) if other != face // 2]
        index = np.arange(number)[:, None]
        square = (0.5 + index * np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])) % 1.0
        side = 2 * (face % 2) - 1  # opposite faces are mirror images through the centre
        part = np.empty((number, 3))
        part[:, axis] = half[axis] * side
        part[:, others] = half[others] * (2.0 * square - 1.0) * side
        points.append(part)
    return np.vstack(points)


Motion = Callable[[float], np.ndarray]
"""Displacement (B, 3) in m of an obstacle since the start of the movement, at a time in s."""


@dataclass(frozen=True)
class CloudBatch:
    """One obstacle in each of B scenarios, in the scenarios' local frames; see `cloud_batch`."""

    points: np.ndarray  # (B, P, 3) points of the surfaces at the start, m
    centre: np.ndarray  # (B, 3) at the start, m
    radius: np.ndarray  # (B,) virtual radius in m
    motion: Motion | None = None  # displacement over time; None for obstacles at rest

    def where(self, rows: np.ndarray) -> Self:
        """Obstacles of some scenarios, at rest, selected by a mask (B,) or indices."""
        return type(self)(self.points[rows], self.centre[rows], self.radius[rows])

    def displacement(self, time: float) -> np.ndarray:
        """Displacement (B, 3) in m since the start, at a time in s."""
        if self.motion is None:
            return np.zeros_like(self.centre)
        moved = np.asarray(self.motion(time), dtype=float)
        if not np.isfinite(moved).all():
            raise ValueError(f"an obstacle's displacement at {time:g} s is not finite")
        return np.broadcast_to(moved, self.centre.shape)

    def path(self, times: np.ndarray) -> np.ndarray:
        """Displacement (B, T, 3) in m since the start, at times (T,) in s."""
        return np.stack([self.displacement(float(time)) for time in times], axis=1)


def cloud_batch(
    points: np.ndarray,
    centre: np.ndarray | None = None,
    radius: np.ndarray | float | None = None,
    motion: Motion | None = None,
) -> CloudBatch:
    """Clouds of B scenarios from points (B, P, 3) m, at rest by default.

    `centre` (B, 3) m, default: the mean point; `radius` (B,) or scalar, m, default: the mean distance of the
    points from their mean. Raises ValueError: an impossible shape, value or radius.
    """
    points = np.asarray(points, dtype=float)
    check_cloud(points)
    if points.ndim != 3:
        raise ValueError(f"clouds of a batch must be (scenarios, points, 3), have the shape {points.shape}")
    radius = np.broadcast_to(virtual_radius(points) if radius is None else radius, len(points)).astype(float)
    if not (radius > 0.0).all():
        raise ValueError("an obstacle has no extent: its virtual radius must be positive")
    centre = points.mean(axis=1) if centre is None else np.asarray(centre, dtype=float)
    if centre.shape != (len(points), 3) or not np.isfinite(centre).all():
        raise ValueError(f"centres of {len(points)} obstacles must be finite ({len(points)}, 3)")
    return CloudBatch(points, centre, radius, motion)


def constant_velocity(velocity: np.ndarray) -> Motion:
    """Motion with a velocity (B, 3) or (3,) in m/s."""
    return partial(np.multiply, np.asarray(velocity, dtype=float))
