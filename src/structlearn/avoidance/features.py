"""What the avoidance models see of an obstacle: 17 features in the local frame (IV.8.1).

    0-2    centre - x                                    m
    3-11   three closest points - x, closest first,
           as [x1 x2 x3 y1 y2 y3 z1 z2 z3]               m
    12-14  tau v                                         m
    15     |centre - x|                                  m
    16     cosine of the angle between v and the direction to the closest point

The order and the last feature are those of the author's data files; the text has the angle itself, and to the
centre.
"""

from collections.abc import Callable

import numpy as np

from structlearn.core.compilation import numba
from structlearn.core.errors import InputError

TO_CENTRE = slice(0, 3)
TO_POINTS = slice(3, 12)
SCALED_VELOCITY = slice(12, 15)
CENTRE_DISTANCE = 15
APPROACH_COSINE = 16

CLOSEST_POINTS = 3

NAMES = (
    *(f"centre_{axis}" for axis in "xyz"),
    *(f"point_{axis}{point}" for axis in "xyz" for point in (1, 2, 3)),
    *(f"tau_velocity_{axis}" for axis in "xyz"),
    "centre_distance",
    "approach_cosine",
)
"""Names of the 17 columns."""

MIRROR = (1.0, -1.0, 1.0)
"""What a vector of the local frame is multiplied by if the scene is mirrored in the plane y = 0."""

MIRROR_SIGNS = np.array([*MIRROR, *np.repeat(MIRROR, CLOSEST_POINTS), *MIRROR, 1.0, 1.0])
"""Likewise of the 17 columns."""

CouplingModel = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Avoidance model: features (B, 17), phase (B,), phase velocity (B,) -> coupling terms (B, 3) in m."""


def features(
    position: np.ndarray, velocity: np.ndarray, tau: float, cloud: np.ndarray, centre: np.ndarray
) -> np.ndarray:
    """Features of a batch of states; leading axes broadcast, so many states may share one cloud.

    Args:
        position: (..., 3) end-effector in m.
        velocity: (..., 3) of the end-effector in m/s.
        tau: time constant in s; tau v does not depend on the movement's duration.
        cloud: (..., P, 3) points of the obstacle's surface in m, P >= 3.
        centre: (..., 3) m.

    Returns:
        (..., 17) features. The cosine is -1 where it is undefined: at rest, or on the closest point.

    Raises:
        InputError: a wrong shape, fewer than three points, a tau that is not positive, NaN or infinity.
    """
    position, velocity = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    cloud, centre = np.asarray(cloud, dtype=float), np.asarray(centre, dtype=float)
    _check_shapes(position, velocity, cloud, centre)
    if not 0.0 < tau < np.inf:
        raise InputError(f"obstacle features: tau must be positive and finite, is {tau}")
    with np.errstate(invalid="ignore"):  # what is not finite is named below
        to_centre = centre - position
        to_points = _closest_points(position, cloud)  # (..., 3 points, 3 axes)
        values = np.empty(
            (*np.broadcast_shapes(to_points.shape[:-2], to_centre.shape[:-1], velocity.shape[:-1]), 17)
        )
        values[..., TO_CENTRE] = to_centre
        for axis in range(3):
            first = TO_POINTS.start + CLOSEST_POINTS * axis
            values[..., first : first + CLOSEST_POINTS] = to_points[..., axis]
        values[..., SCALED_VELOCITY] = tau * velocity
        values[..., CENTRE_DISTANCE] = _norm(to_centre)
        values[..., APPROACH_COSINE] = _cosine(velocity, to_points[..., 0, :])
    if not np.isfinite(values).all():
        names = ("position", "velocity", "cloud", "centre")
        arrays = (position, velocity, cloud, centre)
        bad = [name for name, array in zip(names, arrays, strict=True) if not np.isfinite(array).all()]
        raise InputError(f"obstacle features: not finite: {', '.join(bad) or 'too large numbers'}")
    return values


def displaced(features: np.ndarray, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
    """The same obstacles as a hand sees them that is elsewhere, and moves otherwise.

    The three points stay those that were closest: it is the obstacle that is seen from elsewhere, not others.
    `features` (..., 17); `position` (..., 3) by which the hand is off, m; `scaled_velocity` (..., 3) by which
    tau v is off, m. Returns (..., 17).
    """
    found = np.array(features, dtype=float)
    found[..., TO_CENTRE] -= position
    found[..., TO_POINTS] -= np.repeat(position, CLOSEST_POINTS, axis=-1)
    found[..., SCALED_VELOCITY] += scaled_velocity
    found[..., CENTRE_DISTANCE] = _norm(found[..., TO_CENTRE])
    nearest = found[..., TO_POINTS][..., ::CLOSEST_POINTS]
    found[..., APPROACH_COSINE] = _cosine(found[..., SCALED_VELOCITY], nearest)
    return found


def closest_distance(position: np.ndarray, cloud: np.ndarray) -> np.ndarray:
    """Distance to the closest point of a cloud.

    `position` (..., 3) m; `cloud` (..., P, 3) m. Returns (...) m; NaN where an input is not finite.
    """
    return _norm(_closest_points(position, cloud)[..., 0, :])


def _check_shapes(position: np.ndarray, velocity: np.ndarray, cloud: np.ndarray, centre: np.ndarray) -> None:
    vectors = {"position": position, "velocity": velocity, "centre": centre}
    for name, array in vectors.items():
        if array.ndim < 1 or array.shape[-1] != 3:
            raise InputError(f"obstacle features: {name} must be (..., 3), is {array.shape}")
    if cloud.ndim < 2 or cloud.shape[-1] != 3:
        raise InputError(f"obstacle features: cloud must be (..., P, 3), is {cloud.shape}")
    if cloud.shape[-2] < CLOSEST_POINTS:
        raise InputError(f"obstacle features: {cloud.shape[-2]} points in a cloud, at least 3 are needed")
    try:
        np.broadcast_shapes(*(array.shape[:-1] for array in vectors.values()), cloud.shape[:-2])
    except ValueError as error:
        shapes = [array.shape for array in (position, velocity, cloud, centre)]
        raise InputError(f"obstacle features: batches do not fit together: {shapes}") from error


def _norm(vectors: np.ndarray) -> np.ndarray:
    """Euclidean length (...) of vectors (..., 3)."""
    return np.sqrt(np.einsum("...i,...i", vectors, vectors))


def _cosine(velocity: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Cosine (...) of the angle between two vectors (..., 3), -1 where one of them is zero."""
    lengths = _norm(velocity) * _norm(direction)
    defined = lengths > 0.0
    product = np.einsum("...i,...i", velocity, direction)
    return np.where(defined, np.clip(product / np.where(defined, lengths, 1.0), -1.0, 1.0), -1.0)


def _closest_points(position: np.ndarray, cloud: np.ndarray) -> np.ndarray:
    """Vectors (..., 3 points, 3 axes) to the three closest points; leading axes broadcast."""
    clouds = np.ascontiguousarray(cloud, dtype=float).reshape(-1, *cloud.shape[-2:])
    which = np.zeros(position.shape[:-1], dtype=int) + np.arange(len(clouds)).reshape(cloud.shape[:-2])
    positions, vectors = np.empty((*which.shape, 3)), np.empty((*which.shape, CLOSEST_POINTS, 3))
    positions[...] = position
    _to_closest_points(
        positions.reshape(-1, 3), clouds, which.ravel(), vectors.reshape(-1, CLOSEST_POINTS, 3)
    )
    return vectors


@numba.njit(cache=True)
def _to_closest_points(
    positions: np.ndarray, clouds: np.ndarray, which: np.ndarray, vectors: np.ndarray
) -> None:
    """Write the vectors (N, 3, 3) from positions (N, 3) to the three closest points of clouds (M, P, 3).

    Closest first, of cloud `which` (N,); NaN if anything is not finite. One pass and no intermediate arrays:
    twenty times quicker than distances, argpartition and take.
    """
    for n in range(len(positions)):
        _to_closest_of_one(positions[n], clouds[which[n]], vectors[n])


@numba.njit(cache=True)
def _to_closest_of_one(position: np.ndarray, cloud: np.ndarray, vectors: np.ndarray) -> None:
    """Write the vectors (3, 3) from one position to the three closest points of one cloud (P, 3)."""
    first = second = third = np.inf
    at_first = at_second = at_third = 0
    total = 0.0
    for i in range(cloud.shape[0]):
        squared = 0.0
        for d in range(3):
            squared += (cloud[i, d] - position[d]) ** 2
        total += squared
        if squared < third:
            if squared < second:
                third, at_third = second, at_second
                if squared < first:
                    second, at_second = first, at_first
                    first, at_first = squared, i
                else:
                    second, at_second = squared, i
            else:
                third, at_third = squared, i
    finite = np.isfinite(total)  # comparisons with NaN are false: such a point would be passed over
    for d in range(3):
        vectors[0, d] = cloud[at_first, d] - position[d] if finite else np.nan
        vectors[1, d] = cloud[at_second, d] - position[d] if finite else np.nan
        vectors[2, d] = cloud[at_third, d] - position[d] if finite else np.nan
