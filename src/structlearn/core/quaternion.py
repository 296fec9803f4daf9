"""Unit quaternions, scalar first, as in appendix B of the dissertation.

Q = [r, q] with r the scalar; Q and -Q are the same rotation. All functions are batched over leading axes and
broadcast like numpy. The dissertation's `log` is half the rotation vector; `log` and `exp` here keep that
convention, and `rotation_vector` / `from_rotation_vector` use the full vector.
"""

from typing import Any

import numpy as np

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product a o b (eq. B.1): rotation b followed by a, both in the base frame, (..., 4)."""
    components = (np.moveaxis(np.asarray(q, dtype=float), -1, 0) for q in (a, b))
    return np.stack(product_components(*components), axis=-1)


Components = np.ndarray | tuple[float, float, float, float]
"""Components of a quaternion; compiled functions use tuples, which unlike arrays need no allocation."""


def product_components(a: Components, b: Components) -> tuple[Any, ...]:
    """Components of the Hamilton product of (4, ...) quaternions; also compiled by numba."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """Conjugate [r, -q] (eq. B.2), the inverse of a unit quaternion. Shape (..., 4) -> (..., 4)."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalised(q: np.ndarray) -> np.ndarray:
    """Quaternions scaled to unit norm. Shape (..., 4) -> (..., 4)."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def log(q: np.ndarray) -> np.ndarray:
    """Logarithm of unit quaternions (eq. B.3), half the rotation vector: (..., 4) -> (..., 3) rad.

    The half angle is atan2(|q|, r), which keeps full precision near the identity, where arccos(r) loses half
    the digits. Q and -Q have different logarithms; see `shortest` for the shorter rotation.
    """
    q = np.asarray(q, dtype=float)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half_angle = np.arctan2(sine, q[..., :1])
    tiny = sine < 1e-12  # |q| / sin -> 1 at the identity
    return q[..., 1:] * np.where(tiny, 1.0, half_angle / np.where(tiny, 1.0, sine))


def exp(half_vector: np.ndarray) -> np.ndarray:
    """Exponential map (eq. B.4): half rotation vectors (..., 3) in rad -> unit quaternions (..., 4)."""
    half_vector = np.asarray(half_vector, dtype=float)
    half_angle = np.linalg.norm(half_vector, axis=-1, keepdims=True)
    return np.concatenate(
        [np.cos(half_angle), np.sinc(half_angle / np.pi) * half_vector], axis=-1
    )  # numpy's sinc(x / pi) is sin(x) / x with its limit at 0


def shortest(q: np.ndarray) -> np.ndarray:
    """Of Q and -Q, the one with r >= 0, whose logarithm is the shorter rotation, (..., 4)."""
    q = np.asarray(q, dtype=float)
    return np.where(q[..., :1] < 0, -q, q)


def rotation_vector(q: np.ndarray) -> np.ndarray:
    """Rotation vectors of the shorter rotation, 2 log(Q): (..., 4) -> (..., 3) rad, norm in [0, pi]."""
    return 2.0 * log(shortest(q))


def from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Unit quaternions of rotation vectors in rad: (..., 3) -> (..., 4)."""
    return exp(0.5 * np.asarray(vector, dtype=float))


def difference(target: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rotation vector (..., 3) rad from Q to the target, the shorter way: 2 log(Q_target o Q*)."""
    return rotation_vector(product(target, conjugate(q)))


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle of the rotation between two orientations, in [0, pi] rad: (..., 4), (..., 4) -> (...)."""
    return np.linalg.norm(difference(a, b), axis=-1)


def rotate(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotated vectors Q o [0, v] o Q*: (..., 4), (..., 3) -> (..., 3)."""
    q = np.asarray(q, dtype=float)
    vector = np.asarray(vector, dtype=float)
    axis = np.broadcast_to(q[..., 1:], np.broadcast_shapes(q[..., 1:].shape, vector.shape))
    twice_cross = 2.0 * np.cross(axis, vector)
    return vector + q[..., :1] * twice_cross + np.cross(axis, twice_cross)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of one unit quaternion: (4,) -> (3, 3), so that `matrix(q) @ v` is `rotate(q, v)`."""
    w, x, y, z = q
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def sign_continuous(path: np.ndarray) -> np.ndarray:
    """The same rotations (..., T, 4) without sign flips along the path; the first one is kept."""
    path = np.asarray(path, dtype=float)
    flips = np.sum(path[..., 1:, :] * path[..., :-1, :], axis=-1) < 0
    signs = np.where(np.cumsum(flips, axis=-1) % 2 == 1, -1.0, 1.0)
    return np.concatenate([path[..., :1, :], path[..., 1:, :] * signs[..., None]], axis=-2)


def mean(q: np.ndarray) -> np.ndarray:
    """Mean orientation (4,), r >= 0, of (L, 4): eigenvector of sum Q Q^T with the largest eigenvalue."""
    q = np.asarray(q, dtype=float)
    _, vectors = np.linalg.eigh(q.T @ q)
    principal = vectors[:, -1]
    return principal * np.sign(principal[np.flatnonzero(principal)[0]])


def interpolate(times: np.ndarray, stamps: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Spherical linear interpolation at times (M,) of a path (T, 4) with increasing stamps (T,): (M, 4)."""
    left = np.clip(np.searchsorted(stamps, times, side="right") - 1, 0, len(stamps) - 2)
    fraction = (times - stamps[left]) / (stamps[left + 1] - stamps[left])
    step = difference(path[left + 1], path[left])
    return product(from_rotation_vector(fraction[:, None] * step), path[left])


def angular_velocity(path: np.ndarray, dt: float) -> np.ndarray:
    """Angular velocity (T, 3) rad/s in the base frame by central differences, one-sided at the ends."""
    steps = difference(path[1:], path[:-1]) / dt
    return np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])


def from_xyzw(q: np.ndarray) -> np.ndarray:
    """Scalar-first from scalar-last quaternions (ROS, PyBullet, Pinocchio, scipy). Shape (..., 4)."""
    return np.roll(q, 1, axis=-1)


def to_xyzw(q: np.ndarray) -> np.ndarray:
    """Scalar-last quaternions (ROS, PyBullet, Pinocchio, scipy) from scalar-first ones, (..., 4)."""
    return np.roll(q, -1, axis=-1)
