"""Skins with electrodes: positions of the electrodes, and geometry of the touched surface.

Every skin is a core inflated by a radius. The core is an axis-parallel box, which degenerates to a segment
(BioTac), a rectangle (flat pad) or a point (sphere).

Frame of a finger: origin where the round tip begins, x towards the tip, z into the finger; objects touch from
-z. Surface coordinates are arc lengths along the finger (x) and across it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

# Electrodes 1-19 of the BioTac in mm (published driver code of the sensor; origin: its product manual)
_SIDE = [
    (0.993, -4.855, -1.116),
    (-2.7, -3.513, -3.67),
    (-6.2, -3.513, -3.67),
    (-8.0, -4.956, -1.116),
    (-10.5, -3.513, -3.67),
    (-13.4, -4.956, -1.116),
]
ELECTRODES_MM = np.array(
    _SIDE
    + [(4.763, 0, -2.33), (3.031, -1.95, -3.33), (3.031, 1.95, -3.33), (1.299, 0, -4.33)]
    + [(x, -y, z) for x, y, z in _SIDE]
    + [(-2.8, 0, -5.08), (-9.8, 0, -5.08), (-13.6, 0, -5.08)]
)
_SIDE_NORMALS = [
    (0.196, -0.956, -0.220),
    (0, -0.692, -0.722),
    (0, -0.692, -0.722),
    (0, -0.976, -0.220),
    (0, -0.692, -0.722),
    (0, -0.976, -0.220),
]
NORMALS = np.array(
    _SIDE_NORMALS + [(0.5, 0, -0.866)] * 4 + [(x, -y, z) for x, y, z in _SIDE_NORMALS] + [(0, 0, -1)] * 3,
    dtype=float,
)
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)

SKIN_RADIUS_MM = 7.0  # outer skin: half cylinder behind the tip (x <= 0), quarter sphere at the tip
SKIN_LENGTH_MM = 15.0  # length of the cylinder with electrodes under it
# m from the surface to the electrodes: fluid and skin of the BioTac, whose core has a radius of 5.08 mm
DEPTH = 1.92e-3

SEGMENTS = 16  # per shortest path; over a quarter circle, chords are 0.04 % too short
ROUNDS = 300  # of shortening; the longest wave of a path with 16 segments decays to 1/e in 50


@dataclass(frozen=True)
class Skin:
    """A touched surface with E electrodes under it, in the finger's frame."""

    name: str
    electrodes: np.ndarray  # (E, 3) m
    normals: np.ndarray  # (E, 3) unit, outwards
    core_low: np.ndarray  # (3,) m, lower corner of the core
    core_high: np.ndarray  # (3,) m, upper corner of the core
    radius: float  # m from the core to the surface
    along: tuple[float, float]  # (2,) m, range of the surface coordinate along the finger
    across: tuple[float, float]  # (2,) m, range of the surface coordinate across the finger

    def core(self, points: np.ndarray) -> np.ndarray:
        """Nearest points of the core, (..., 3) m -> (..., 3) m."""
        return np.clip(points, self.core_low, self.core_high)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) m projected onto the surface, away from the core; NaN for points on the core."""
        core = self.core(points)
        outwards = points - core
        with np.errstate(invalid="ignore"):
            return core + self.radius * outwards / np.linalg.norm(outwards, axis=-1, keepdims=True)

    def normal(self, points: np.ndarray) -> np.ndarray:
        """Outward unit normals (..., 3) at points (..., 3) m of the surface."""
        return (points - self.core(points)) / self.radius

    def surface(self, along: np.ndarray | float, across: np.ndarray | float) -> np.ndarray:
        """Points (..., 3) m of the surface at surface coordinates (...) m along the finger and across it."""
        along, across = np.broadcast_arrays(np.asarray(along, dtype=float), across)
        core = self.core(np.stack([along, across, np.zeros_like(along)], axis=-1))
        over = (along - core[..., 0]) / self.radius
        around = (across - core[..., 1]) / self.radius
        normal = np.stack(
            [np.sin(over), np.cos(over) * np.sin(around), -np.cos(over) * np.cos(around)], axis=-1
        )
        return core + self.radius * normal

    def coordinates(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Surface coordinates along and across, (...) m each, of surface points (..., 3) m."""
        core = self.core(points)
        normal = self.normal(points)
        along = core[..., 0] + self.radius * np.arcsin(np.clip(normal[..., 0], -1, 1))
        across = core[..., 1] + self.radius * np.arctan2(normal[..., 1], -normal[..., 2])
        return along, across

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Whether surface points (..., 3) m are within the ranges of the skin, (...)."""
        coordinates = np.stack(self.coordinates(points), axis=-1)
        low, high = np.transpose([self.along, self.across])
        return ((low <= coordinates) & (coordinates <= high)).all(axis=-1)


def biotac() -> Skin:
    """Skin of the BioTac: half cylinder with a quarter sphere at the tip, 19 electrodes."""
    radius = 1e-3 * SKIN_RADIUS_MM
    return Skin(
        name="biotac",
        electrodes=1e-3 * ELECTRODES_MM,
        normals=NORMALS,
        core_low=np.array([-1e-3 * SKIN_LENGTH_MM, 0.0, 0.0]),
        core_high=np.zeros(3),
        radius=radius,
        along=(-1e-3 * SKIN_LENGTH_MM, 0.5 * np.pi * radius),
        across=(-0.5 * np.pi * radius, 0.5 * np.pi * radius),
    )


def flat_pad() -> Skin:
    """Flat pad of 20 x 14 mm with a grid of 5 x 4 electrodes, as deep under the skin as the BioTac's."""
    grid = np.meshgrid(np.linspace(-0.018, 0.0, 5), np.linspace(-0.006, 0.006, 4), indexing="ij")
    low, high = np.array([-0.019, -0.007, 0.0]), np.array([0.001, 0.007, 0.0])
    return _over_core("flat_pad", low, high, 2e-3, grid, 0.0)


def sphere() -> Skin:
    """Half sphere of 10 mm radius, with electrodes on a grid of its surface coordinates."""
    radius = 10e-3
    grid = np.meshgrid(radius * np.linspace(-1.0, 1.0, 5), radius * np.linspace(-1.0, 1.0, 4), indexing="ij")
    return _over_core("sphere", np.zeros(3), np.zeros(3), radius, grid, 0.5 * np.pi * radius)


def _over_core(
    name: str, low: np.ndarray, high: np.ndarray, radius: float, grid: Sequence[np.ndarray], beyond: float
) -> Skin:
    """Skin that extends `beyond` past its core; electrodes lie `DEPTH` below a grid of coordinates."""
    along, across = ((start - beyond, end + beyond) for start, end in zip(low[:2], high[:2], strict=True))
    none = np.empty((0, 3))
    bare = Skin(name, none, none, low, high, radius, along, across)
    points = bare.surface(*(values.ravel() for values in grid))
    normals = bare.normal(points)
    return replace(bare, electrodes=points - DEPTH * normals, normals=normals)


SKINS: Mapping[str, Skin] = {skin.name: skin for skin in (biotac(), flat_pad(), sphere())}


def skin_distance(first: np.ndarray, second: np.ndarray, skin: Skin) -> np.ndarray:
    """Length (B,) m of the shortest path on a skin between points `first` and `second` of it, (B, 3) m.

    A chain of points is pulled taut: each point moves to the middle of its neighbours and back to the skin.
    """
    part = np.linspace(0.0, 1.0, SEGMENTS + 1)[:, None, None]
    path = skin.project((1 - part) * first + part * second)  # (SEGMENTS + 1, B, 3)
    for _ in range(ROUNDS):
        path[1:-1] = skin.project(0.5 * (path[:-2] + path[2:]))
    return path_length(path)


def path_length(path: np.ndarray) -> np.ndarray:
    """Length (...) of paths (N, ..., 3) along their first axis."""
    return np.linalg.norm(np.diff(path, axis=0), axis=-1).sum(axis=0)


@dataclass(frozen=True)
class MapAlignment:
    """An isometry of the plane: rotation, possibly reflection, and shift."""

    centre: np.ndarray  # (2,) centre of the map
    turn: np.ndarray  # (2, 2) orthogonal
    place: np.ndarray  # (2,) where the centre is placed

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Transformed points (..., 2) of the map."""
        return (points - self.centre) @ self.turn + self.place


def align_map(points: np.ndarray, places: np.ndarray) -> MapAlignment:
    """Isometry that aligns a latent map with the skin in the least-squares sense (orthogonal Procrustes).

    The loss of a map contains distances only, so its orientation is arbitrary. `points` (N, 2) of the map, in
    the unit of the `places` (N, 2), e.g. surface coordinates.
    """
    centre, place = points.mean(axis=0), places.mean(axis=0)
    left, _, right = np.linalg.svd((points - centre).T @ (places - place))
    return MapAlignment(centre, left @ right, place)
