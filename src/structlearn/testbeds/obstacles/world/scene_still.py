"""A still of the simulated scene: hands that reach past a sphere, a cube and a cylinder."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.shapes import Obstacle
from structlearn.primitives.position import PositionPrimitive
from structlearn.simulation.still import Solid, View, still

LANE_M = 0.42  # between neighbouring reaches in the picture; in truth all are at one place

HAND_M, BEAD_M, SPACING_M = 0.022, 0.006, 0.018
"""Radii of the hand and of the beads of a path, and about how far apart these are."""

SHOWN_ROWS = slice(90, 530)  # of the picture: above and below is nothing but table

OBSTACLE, HAND, DEMONSTRATED, BARE, TABLE = (
    (0.84, 0.37, 0.0, 1.0),
    (0.30, 0.33, 0.36, 1.0),
    (0.44, 0.47, 0.50, 1.0),
    (0.11, 0.12, 0.14, 1.0),
    (0.93, 0.92, 0.90, 1.0),
)
"""Red, green, blue, opacity; people and their paths are grey, as in all figures."""


@dataclass(frozen=True)
class Lane:
    """A reach past an obstacle."""

    obstacle: Obstacle  # base frame
    demonstrated: np.ndarray  # (T, 3) m, base frame
    bare: np.ndarray  # (T, 3) m, the reach without avoidance


def reaches_still(lanes: Sequence[Lane], baseline: PositionPrimitive) -> np.ndarray:
    """Draw reaches beside each other, the hand of each above its obstacle.

    `baseline`: whose local frame says what is beside. Returns (H, W, 3) bytes.
    """
    along, across, _ = baseline_axes(baseline).T
    middle = 0.5 * (baseline.start + baseline.goal)
    floor = min(lane.obstacle.centre[2] - lane.obstacle.half_size[2] for lane in lanes)
    solids = [Solid("box", (1.5, 1.2, 0.01), (middle[0], middle[1], floor - 0.011), colour=TABLE)]
    for number, lane in enumerate(lanes):
        shift = (0.5 * (len(lanes) - 1) - number) * LANE_M * across
        solids += [_solid(lane.obstacle, shift)]
        solids += [Solid("sphere", (BEAD_M,), point + shift, colour=BARE) for point in _beads(lane.bare)]
        path = lane.demonstrated
        solids += [Solid("sphere", (BEAD_M,), point + shift, colour=DEMONSTRATED) for point in _beads(path)]
        over = path[np.abs((path - lane.obstacle.centre) @ along).argmin()]
        solids.append(Solid("sphere", (HAND_M,), over + shift, colour=HAND))
    view = View(target=(*middle[:2], floor + 0.09), distance=1.95, yaw_deg=14.0, pitch_deg=-22.0)
    return still(view, solids)[SHOWN_ROWS]


def _beads(path: np.ndarray) -> Iterator[np.ndarray]:
    """Points of a path (T, 3) at equal distances, but for its rests."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    places = np.linspace(0.0, length[-1], max(2, round(length[-1] / SPACING_M)))
    yield from np.stack([np.interp(places, length, values) for values in path.T], axis=1)


def _solid(obstacle: Obstacle, shift: np.ndarray) -> Solid:
    from scipy.spatial.transform import Rotation

    kind = {"sphere": "sphere", "cube": "box", "cylinder": "cylinder"}[obstacle.shape]
    half = obstacle.half_size
    sizes = {"sphere": half[:1], "box": half, "cylinder": np.array([half[0], 2.0 * half[2]])}
    turn = Rotation.from_matrix(obstacle.rotation).as_quat(scalar_first=True)
    return Solid(kind, sizes[kind], obstacle.centre + shift, turn, OBSTACLE)
