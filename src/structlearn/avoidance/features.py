"""Obstacle features of the avoidance models: 17 values in the local frame (IV.8.1).

    0-2    centre - x                                    m
    3-11   three closest points - x, closest first,
           as [x1 x2 x3 y1 y2 y3 z1 z2 z3]               m
    12-14  tau v                                         m
    15     |centre - x|                                  m
    16     cosine of the angle between v and the direction to the closest point

Order and last feature are those of the author's data files; the text uses the angle itself, to the centre.
"""

from collections.abc import Callable, Mapping

import numpy as np

from structlearn.core.compilation import numba

TO_CENTRE, TO_POINTS, SCALED_VELOCITY = slice(0, 3), slice(3, 12), slice(12, 15)
CENTRE_DISTANCE, APPROACH_COSINE = 15, 16
CLOSEST_POINTS = 3

NAMES = (
    *(f"centre_{axis}" for axis in "xyz"),
    *(f"point_{axis}{point}" for axis in "xyz" for point in (1, 2, 3)),
    *(f"tau_velocity_{axis}" for axis in "xyz"),
    "centre_distance",
    "approach_cosine",
)
MIRROR = (1.0, -1.0, 1.0)
"""Signs of a local vector after mirroring the scene in the plane y = 0."""

MIRROR_SIGNS = np.array([*MIRROR, *np.repeat(MIRROR, CLOSEST_POINTS), *MIRROR, 1.0, 1.0])
"""Signs of the 17 columns."""

CouplingModel = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Avoidance model: features (B, 17), phase (B,), phase velocity (B,) -> coupling terms (B, 3) in m."""


def obstacle_features(
    position: np.ndarray, velocity: np.ndarray, tau: float, cloud: np.ndarray, centre: np.ndarray
) -> np.ndarray:
    """Features (..., 17) of a batch of states; leading axes broadcast, so states may share one cloud.

    `position` (..., 3) m; `velocity` (..., 3) m/s; `tau`: time constant in s; `cloud` (..., P, 3) m, P >= 3;
    `centre` (..., 3) m. The cosine is -1 where it is undefined: at rest, or on the closest point. Raises
    ValueError: a wrong shape, fewer than three points, a tau that is not positive, NaN or infinity.
    """
    given = {"position": position, "velocity": velocity, "centre": centre, "cloud": cloud}
    arrays = {name: np.asarray(array, dtype=float) for name, array in given.items()}
    batch = _batch_shape(arrays)
    if not 0.0 < tau < np.inf:
        raise ValueError(f"obstacle features: tau must be positive and finite, is {tau}")
    position, velocity, centre, cloud = arrays.values()
    values = np.empty((*batch, 17))
    with np.errstate(invalid="ignore"):  # values that are not finite are reported below
        to_points = _closest_points(position, cloud)  # (..., 3 points, 3 axes)
        values[..., TO_CENTRE] = centre - position
        values[..., TO_POINTS] = np.swapaxes(to_points, -1, -2).reshape(*to_points.shape[:-2], 9)
        values[..., SCALED_VELOCITY] = tau * velocity
        values[..., CENTRE_DISTANCE] = _norm(centre - position)
        values[..., APPROACH_COSINE] = _cosine(velocity, to_points[..., 0, :])
    if not np.isfinite(values).all():
        bad = [name for name, array in arrays.items() if not np.isfinite(array).all()]
        raise ValueError(f"obstacle features: not finite: {', '.join(bad) or 'too large numbers'}")
    return values


def displaced(features: np.ndarray, position: np.ndarray, scaled_velocity: np.ndarray) -> np.ndarray:
    """Features (..., 17) after displacing the hand by a position and a tau v, (..., 3) m.

    The three closest points are assumed to stay the same.
    """
    values = np.array(features, dtype=float)
    values[..., TO_CENTRE] -= position
    values[..., TO_POINTS] -= np.repeat(position, CLOSEST_POINTS, axis=-1)
    values[..., SCALED_VELOCITY] += scaled_velocity
    values[..., CENTRE_DISTANCE] = _norm(values[..., TO_CENTRE])
    nearest = values[..., TO_POINTS][..., ::CLOSEST_POINTS]
    values[..., APPROACH_COSINE] = _cosine(values[..., SCALED_VELOCITY], nearest)
    return values


def closest_distance(position: np.ndarray, cloud: np.ndarray) -> np.ndarray:
    """Distance (...) m of positions (..., 3) to the closest point of clouds (..., P, 3), or NaN."""
    return _norm(_closest_points(position, cloud)[..., 0, :])


def _batch_shape(arrays: Mapping[str, np.ndarray]) -> tuple[int, ...]:
    """Leading axes of the arguments of `obstacle_features`. Raises ValueError: they do not broadcast."""
    batches = []
    for name, array in arrays.items():
        form = "(..., P, 3)" if name == "cloud" else "(..., 3)"
        axes = form.count(",")
        if array.ndim < axes or array.shape[-1] != 3:
            raise ValueError(f"obstacle features: {name} must be {form}, is {array.shape}")
        batches.append(array.shape[:-axes])
    if (points := arrays["cloud"].shape[-2]) < CLOSEST_POINTS:
        raise ValueError(f"obstacle features: {points} points in a cloud, at least 3 are needed")
    try:
        return np.broadcast_shapes(*batches)
    except ValueError as error:
        shapes = [array.shape for array in arrays.values()]
        raise ValueError(f"obstacle features: batches do not fit together: {shapes}") from error


def _norm(vectors: np.ndarray) -> np.ndarray:
    """Euclidean length (...) of vectors (..., 3)."""
    return np.sqrt(np.einsum("...i,...i", vectors, vectors))


def _cosine(velocity: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Cosine (...) of the angle between two vectors (..., 3); -1 if one of them is zero."""
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

    Closest first, in cloud `which` (N,); NaN if anything is not finite. A single pass without temporaries is
    twenty times faster than distances, argpartition and take.
    """
    for n in range(len(positions)):
        position, cloud = positions[n], clouds[which[n]]
        first = second = third = np.inf
        at_first = at_second = at_third = 0
        total = 0.0
        for i in range(cloud.shape[0]):
            squared = 0.0
            for d in range(3):
                squared += (cloud[i, d] - position[d]) ** 2
            total += squared
            if squared < first:
                third, at_third, second, at_second = second, at_second, first, at_first
                first, at_first = squared, i
            elif squared < second:
                third, at_third = second, at_second
                second, at_second = squared, i
            elif squared < third:
                third, at_third = squared, i
        finite = np.isfinite(total)  # comparisons with NaN are False and would skip such a point
        for d in range(3):
            vectors[n, 0, d] = cloud[at_first, d] - position[d] if finite else np.nan
            vectors[n, 1, d] = cloud[at_second, d] - position[d] if finite else np.nan
            vectors[n, 2, d] = cloud[at_third, d] - position[d] if finite else np.nan
