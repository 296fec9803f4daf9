"""Features of a whole scene: the path ahead along a planar cost-to-go (beyond IV.8).

The 17 features of the text describe one obstacle, so their models ignore others beside it and may head where
there is no gap. Here any number of shapes act through the distance d to the nearest of them:

    w(x) = 1 + a exp(-max(d, 0) / s) + b max(0, 1 - d / r)         |grad C(x)| = w(x),  C(goal) = 0

C, the cost of the cheapest path from x to the goal, is computed on a grid over the horizontal plane of the
reach by fast sweeping (Zhao 2005), first-order upwind; its steepest descent is that path. Models see where
the path leads within some distances, in the local frame; from people they learn how closely, when and how
smoothly it is followed. Paths over or under an obstacle are not searched.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from structlearn.avoidance.features import MIRROR
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.compilation import numba
from structlearn.core.params import Parameters

CELL_M = 0.01  # of the grid: a clearance is several cells wide
MARGIN_M = 0.05  # of the grid around start, goal and all shapes: paths may lead around the outermost
NEARNESS_M = 0.05  # s of w(x), over which the cost of a path along a surface fades
AHEAD_M = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3)  # distances along the path, denser where the hand acts first
SWEEPS = 40  # maximum, each over the grid in four directions; paths with many bends take about ten
TOLERANCE = 1e-9  # m of cost-to-go; sweeping ends when no cell improves by more
STEP_CELLS = 0.5  # step along the path, in cells; directions are interpolated between their centres


class LookAheadParameters(Parameters):
    """Costs of the plane around shapes. Fields: `defaults.obstacles.look_ahead`."""

    clearance_m: float = Field(gt=0, le=0.5)
    blocked_cost: float = Field(ge=0)
    nearness_cost: float = Field(ge=0)


@dataclass(frozen=True)
class CostToGo:
    """Cost-to-go and cheapest paths to one goal in a plane."""

    origin: np.ndarray  # (2,) m, centre of the first cell, base frame
    cell: float  # m
    goal: np.ndarray  # (2,) m
    cost: np.ndarray  # (X, Y) cost-to-go at the cells' centres, in m of free path
    direction: np.ndarray  # (X, Y, 2) unit vectors of steepest descent, 0 at the goal

    def paths(self, points: np.ndarray, ahead: Sequence[float] | np.ndarray) -> np.ndarray:
        """Points (N, L, 2) m on the cheapest paths from points (N, 2), at rising distances `ahead` (L,) m.

        A path ends at the goal; outside the grid, values are those at its edge.
        """
        values = np.empty((len(points), len(ahead), 2))
        grid = (self.origin, self.cell, self.goal, self.direction)
        _follow(*grid, np.asarray(points, dtype=float), np.asarray(ahead, dtype=float), values)
        return values

    def at(self, points: np.ndarray) -> np.ndarray:
        """Cost-to-go (N,) at points (N, 2), by bilinear interpolation."""
        place = np.clip((points - self.origin) / self.cell, 0.0, np.array(self.cost.shape) - 1.000001)
        corner = place.astype(int)
        (i, j), (u, v) = corner.T, (place - corner).T
        low = (1.0 - v) * self.cost[i, j] + v * self.cost[i, j + 1]
        high = (1.0 - v) * self.cost[i + 1, j] + v * self.cost[i + 1, j + 1]
        return (1.0 - u) * low + u * high


def scene_cost_to_go(
    shapes: Sequence[Obstacle], start: np.ndarray, goal: np.ndarray, parameters: LookAheadParameters
) -> CostToGo:
    """Cost-to-go past all shapes in the horizontal plane halfway up the reach, base frame.

    The grid covers `start` and `goal`, (3,) m. Raises ValueError: one of them is not finite.
    """
    ends = np.array([start, goal], dtype=float)
    if not np.isfinite(ends).all():
        raise ValueError(f"start and goal of a look-ahead must be finite, are {ends.tolist()}")
    corners = [
        shape.centre + side * np.abs(shape.rotation) @ shape.half_size for shape in shapes for side in (-1, 1)
    ]
    points = np.vstack([ends, *corners])[:, :2]
    origin = points.min(axis=0) - MARGIN_M
    count = np.maximum(np.ceil((points.max(axis=0) + MARGIN_M - origin) / CELL_M).astype(int) + 1, 2)
    axes = [low + CELL_M * np.arange(number) for low, number in zip(origin, count, strict=True)]
    cells = np.stack(np.meshgrid(*axes, ends[:, 2].mean(), indexing="ij"), axis=-1)[:, :, 0]  # (X, Y, 3)
    weight = way_cost(nearest_distance(shapes, cells), parameters)
    cost = np.full(weight.shape, np.inf)
    _seed(cost, weight, origin, CELL_M, ends[1, :2])
    _sweep(cost, weight, CELL_M, SWEEPS, TOLERANCE)
    return CostToGo(origin, CELL_M, ends[1, :2], cost, _descent(cost))


def nearest_distance(shapes: Sequence[Obstacle], points: np.ndarray) -> np.ndarray:
    """Signed distance (...) m of points (..., 3) to the nearest shape; infinite without shapes."""
    distances = [shape.signed_distance(points) for shape in shapes]
    return np.min(distances, axis=0) if distances else np.full(points.shape[:-1], np.inf)


def way_cost(distance: np.ndarray, parameters: LookAheadParameters) -> np.ndarray:
    """Cost w (...) per length of path, at signed distances (...) m from the nearest shape."""
    near = parameters.nearness_cost * np.exp(-np.maximum(distance, 0.0) / NEARNESS_M)
    return 1.0 + near + parameters.blocked_cost * np.maximum(0.0, 1.0 - distance / parameters.clearance_m)


def scene_features(
    scene: CostToGo,
    position: np.ndarray,
    scaled_velocity: np.ndarray,
    start: np.ndarray,
    frame: np.ndarray,
    goal: np.ndarray,
) -> np.ndarray:
    """Features (N, 2 L + 9) of a scene and of the hand's motion, in the local frame of the reach.

    `position` (N, 3) m relative to the start; `scaled_velocity` (N, 3) tau v, m; `start` (3,) m, base frame;
    `frame` (3, 3) local to base; `goal` (3,) m, local frame. Columns: x and y of the path at each of the L
    distances `AHEAD_M`; excess of its cost over a straight free path; vector to the goal; tau v; y and z of
    the hand.
    """
    here = (position @ frame.T + start)[:, :2]
    relative = scene.paths(here, AHEAD_M) - here[:, None]  # horizontal: no z in the base frame
    led = (relative @ frame[:2])[..., :2].reshape(len(position), -1)
    excess = scene.at(here) - np.linalg.norm(scene.goal - here, axis=1)
    return np.column_stack([led, excess, goal - position, scaled_velocity, position[:, 1:]])


def mirror_signs() -> np.ndarray:
    """Signs (F,) of the columns of `scene_features` after mirroring the scene in the plane y = 0."""
    led = [1.0, -1.0] * len(AHEAD_M)
    return np.array([*led, 1.0, *MIRROR, *MIRROR, *MIRROR[1:]])


def _descent(cost: np.ndarray) -> np.ndarray:
    """Unit vectors (X, Y, 2) of descent, from the upwind neighbours of each cell."""
    descent, padded = np.zeros((*cost.shape, 2)), np.pad(cost, 1, constant_values=np.inf)
    neighbours = ((padded[:-2, 1:-1], padded[2:, 1:-1]), (padded[1:-1, :-2], padded[1:-1, 2:]))
    for axis, (before, after) in enumerate(neighbours):
        gain = cost - np.minimum(before, after)
        descent[..., axis] = np.where(after < before, 1.0, -1.0) * np.maximum(gain, 0.0)
    length = np.linalg.norm(descent, axis=-1, keepdims=True)
    return descent / np.where(length > 0.0, length, 1.0)


@numba.njit(cache=True)
def _seed(cost: np.ndarray, weight: np.ndarray, origin: np.ndarray, cell: float, goal: np.ndarray) -> None:
    """Initialise the cells around the goal with straight paths."""
    i, j = int((goal[0] - origin[0]) / cell), int((goal[1] - origin[1]) / cell)
    for a in range(max(i, 0), min(i + 2, cost.shape[0])):
        for b in range(max(j, 0), min(j + 2, cost.shape[1])):
            away = np.hypot(origin[0] + cell * a - goal[0], origin[1] + cell * b - goal[1])
            cost[a, b] = weight[a, b] * away


@numba.njit(cache=True)
def _sweep(cost: np.ndarray, weight: np.ndarray, cell: float, sweeps: int, tolerance: float) -> None:
    """Godunov's upwind solution of |grad C| = w by Gauss-Seidel in alternating orders, in place."""
    rows, columns = cost.shape
    for sweep in range(sweeps):
        gain = 0.0
        for a in range(rows):
            i = a if sweep & 1 == 0 else rows - 1 - a
            for b in range(columns):
                j = b if sweep & 2 == 0 else columns - 1 - b
                x = min(cost[i - 1, j] if i > 0 else np.inf, cost[i + 1, j] if i < rows - 1 else np.inf)
                y = min(cost[i, j - 1] if j > 0 else np.inf, cost[i, j + 1] if j < columns - 1 else np.inf)
                step = cell * weight[i, j]
                low, high = min(x, y), max(x, y)
                if low == np.inf:
                    continue
                if high - low >= step:
                    value = low + step
                else:
                    value = 0.5 * (low + high + np.sqrt(2.0 * step**2 - (high - low) ** 2))
                if value < cost[i, j]:
                    gain = max(gain, cost[i, j] - value)
                    cost[i, j] = value
        if gain <= tolerance and sweep >= 4:
            return


@numba.njit(cache=True)
def _follow(
    origin: np.ndarray,
    cell: float,
    goal: np.ndarray,
    direction: np.ndarray,
    points: np.ndarray,
    ahead: np.ndarray,
    values: np.ndarray,
) -> None:
    """Write the points (N, L, 2) at distances `ahead` along the steepest descent."""
    rows, columns = direction.shape[:2]
    for n in range(len(points)):
        x, y, gone = points[n, 0], points[n, 1], 0.0
        for k in range(len(ahead)):
            while gone < ahead[k]:
                step = min(STEP_CELLS * cell, ahead[k] - gone)
                left = np.hypot(goal[0] - x, goal[1] - y)
                if left <= max(step, 1.5 * cell):  # straight through the last cells
                    share = min(1.0, step / left) if left > 0.0 else 1.0
                    x += share * (goal[0] - x)
                    y += share * (goal[1] - y)
                else:
                    p = min(max((x - origin[0]) / cell, 0.0), rows - 1.000001)
                    q = min(max((y - origin[1]) / cell, 0.0), columns - 1.000001)
                    i, j = int(p), int(q)
                    u, v = p - i, q - j
                    along, across = 0.0, 0.0
                    for a in range(2):
                        for b in range(2):
                            share = (u if a else 1.0 - u) * (v if b else 1.0 - v)
                            along += share * direction[i + a, j + b, 0]
                            across += share * direction[i + a, j + b, 1]
                    length = np.hypot(along, across)
                    if length == 0.0:
                        along, across, length = goal[0] - x, goal[1] - y, left
                    x += step * along / length
                    y += step * across / length
                gone += step
            values[n, k, 0], values[n, k, 1] = x, y
