"""Obstacles as an unroll meets them: point clouds, one per scenario, at rest or moving."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from structlearn.avoidance.shapes import check_cloud, virtual_radius
from structlearn.ground.errors import InputError

Motion = Callable[[float], np.ndarray]
"""Displacement (B, 3) in m of an obstacle since the start of the movement, at a time in s."""


@dataclass(frozen=True)
class CloudBatch:
    """One obstacle in each of B scenarios, in the scenarios' local frames; see `cloud_batch`."""

    points: np.ndarray  # (B, P, 3) points of the surfaces at the start, m
    centre: np.ndarray  # (B, 3) at the start, m
    radius: np.ndarray  # (B,) virtual radius in m
    motion: Motion | None = None  # displacement over time; None for obstacles at rest

    def displacement(self, time: float) -> np.ndarray:
        """(B, 3) displacement in m since the start, at a time in s."""
        if self.motion is None:
            return np.zeros_like(self.centre)
        moved = np.asarray(self.motion(time), dtype=float)
        if not np.isfinite(moved).all():
            raise InputError(f"an obstacle's displacement at {time:g} s is not finite")
        return np.broadcast_to(moved, self.centre.shape)

    def path(self, times: np.ndarray) -> np.ndarray:
        """(B, T, 3) displacement in m at times (T,) in s."""
        return np.stack([self.displacement(float(time)) for time in times], axis=1)


def cloud_batch(
    points: np.ndarray,
    centre: np.ndarray | None = None,
    radius: np.ndarray | float | None = None,
    motion: Motion | None = None,
) -> CloudBatch:
    """Clouds of B scenarios; what is not known of the obstacles is taken from their points.

    Args:
        points: (B, P, 3) m.
        centre: (B, 3) m; default the mean point.
        radius: (B,) or one for all, m; default the mean distance of the points to their mean.
        motion: displacement over time; default at rest.

    Raises:
        InputError: there are no points, or they are not (B, P, 3) or not finite; centres likewise; a radius
            is not positive.
    """
    points = np.asarray(points, dtype=float)
    check_cloud(points)
    if points.ndim != 3:
        raise InputError(f"clouds of a batch must be (scenarios, points, 3), have the shape {points.shape}")
    radius = np.broadcast_to(virtual_radius(points) if radius is None else radius, len(points)).astype(float)
    if not (radius > 0.0).all():
        raise InputError("an obstacle has no extent: its virtual radius must be positive")
    centre = points.mean(axis=1) if centre is None else np.asarray(centre, dtype=float)
    if centre.shape != (len(points), 3) or not np.isfinite(centre).all():
        raise InputError(f"centres of {len(points)} obstacles must be finite ({len(points)}, 3)")
    return CloudBatch(points, centre, radius, motion)


def constant_velocity(velocity: np.ndarray) -> Motion:
    """Motion with a velocity (B, 3) or (3,) in m/s."""
    return partial(np.multiply, np.asarray(velocity, dtype=float))
