"""The structures of `inertia_parameters` and their gradients in closed form, compiled.

Parameters theta of the regressor's columns from free parameters, and the way back of a slope: what autograd
does through `link_inertias`, `link_parameters` and `friction_coefficients`, which stay the reference. With G
the slope against the inertia, as symmetric matrix,

    I = L L^T + b 1          dL = 2 G L                                           (spd; cov with tr(G) 1 - G)
    I = R J R^T              dJ = diag(R^T G R)     dv = Jl(v)^T vee(2 G I)       (tri)

where R = exp(v) and Jl is the left Jacobian of the rotation group. Symmetric matrices are tuples
(xx, xy, xz, yy, yz, zz).
"""

import math

import numba
import numpy as np

from structlearn.core.compiled_vectors import cross
from structlearn.rigid_body.inertia_parameters import (
    FLAT_SIGMOID,
    INERTIA_BIAS,
    MASS_BIAS_KG,
    ROUNDING_MARGIN,
    STRUCTURES,
)

NOSTR, SYMM, SPD, TRI, COV = range(len(STRUCTURES))
"""Places of the structures in `STRUCTURES`, by which compiled code knows them."""


@numba.njit(cache=True)
def structure_theta(structure: int, free: np.ndarray, rubbing: np.ndarray, squared: np.ndarray) -> np.ndarray:
    """Parameters of the regressor's columns: (M, 10 n + t n), of nostr (M, 13 n + t n).

    Args:
        structure: its place in `STRUCTURES`.
        free: (M, n, k) of the inertias.
        rubbing: (M, n, t) of friction.
        squared: (t,) whether a coefficient of friction is the square of its free parameter.
    """
    models, links, width = free.shape
    terms = len(squared)
    theta = np.empty((models, links * (width + terms)))
    for model in range(models):
        for link in range(links):
            _link_theta(structure, free[model, link], theta[model, link * width : (link + 1) * width])
            for term in range(terms):
                value = rubbing[model, link, term]
                place = links * width + link * terms + term
                theta[model, place] = value * value if squared[term] else value
    return theta


@numba.njit(cache=True)
def structure_gradient(
    structure: int, free: np.ndarray, rubbing: np.ndarray, squared: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients against free parameters of what has a slope (M, P) against `structure_theta`.

    (M, n, k) of the inertias and (M, n, t) of friction.
    """
    models, links, width = free.shape
    terms = len(squared)
    inertial, rubbed = np.empty_like(free), np.empty_like(rubbing)
    for model in range(models):
        for link in range(links):
            columns = slope[model, link * width : (link + 1) * width]
            _link_gradient(structure, free[model, link], columns, inertial[model, link])
            for term in range(terms):
                value = slope[model, links * width + link * terms + term]
                rubbed[model, link, term] = (
                    2.0 * rubbing[model, link, term] * value if squared[term] else value
                )
    return inertial, rubbed


@numba.njit(cache=True)
def _link_theta(structure: int, free: np.ndarray, theta: np.ndarray) -> None:
    """Mass, first moment, and inertia about the joint's origin: I + (|h|^2 1 - h h^T) / m."""
    mass = free[0] if structure == NOSTR else free[0] * free[0] + MASS_BIAS_KG
    x, y, z = free[1], free[2], free[3]
    theta[0], theta[1:4] = mass, free[1:4]
    shift = (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
    if structure == NOSTR:
        for place, entry in enumerate((0, 1, 2, 1, 3, 4, 2, 4, 5)):
            theta[4 + place] = free[4 + place] + shift[entry] / mass
    else:
        inertia = _inertia(structure, free[4:])
        for entry in range(6):
            theta[4 + entry] = inertia[entry] + shift[entry] / mass


@numba.njit(cache=True)
def _link_gradient(structure: int, free: np.ndarray, slope: np.ndarray, gradient: np.ndarray) -> None:
    """What `_link_theta` does, backwards."""
    mass = free[0] if structure == NOSTR else free[0] * free[0] + MASS_BIAS_KG
    if structure == NOSTR:
        xx, yy, zz = slope[4], slope[8], slope[12]
        xy, xz, yz = slope[5] + slope[7], slope[6] + slope[10], slope[9] + slope[11]
    else:
        xx, xy, xz, yy, yz, zz = slope[4], slope[5], slope[6], slope[7], slope[8], slope[9]
    xy, xz, yz = 0.5 * xy, 0.5 * xz, 0.5 * yz
    moment = (free[1], free[2], free[3])
    turned = _times((xx, xy, xz, yy, yz, zz), moment)
    trace = xx + yy + zz
    for axis in range(3):
        gradient[1 + axis] = slope[1 + axis] + 2.0 * (trace * moment[axis] - turned[axis]) / mass
    lighter = slope[0] - (trace * _dot(moment, moment) - _dot(moment, turned)) / (mass * mass)
    gradient[0] = lighter if structure == NOSTR else 2.0 * free[0] * lighter
    if structure in (NOSTR, SYMM):
        gradient[4:] = slope[4:]
        return
    margin = ROUNDING_MARGIN * trace
    xx, yy, zz = xx + margin, yy + margin, zz + margin
    if structure == COV:  # of tr(S) 1 - S against S
        trace = xx + yy + zz
        xx, xy, xz, yy, yz, zz = trace - xx, -xy, -xz, trace - yy, -yz, trace - zz
    if structure == TRI:
        _triangle_gradient(free[4:], (xx, xy, xz, yy, yz, zz), gradient[4:])
        return
    l11, l22, l33, l21, l31, l32 = free[4], free[5], free[6], free[7], free[8], free[9]
    gradient[4] = 2.0 * (xx * l11 + xy * l21 + xz * l31)
    gradient[5] = 2.0 * (yy * l22 + yz * l32)
    gradient[6] = 2.0 * zz * l33
    gradient[7] = 2.0 * (xy * l11 + yy * l21 + yz * l31)
    gradient[8] = 2.0 * (xz * l11 + yz * l21 + zz * l31)
    gradient[9] = 2.0 * (yz * l22 + zz * l32)


@numba.njit(cache=True)
def _inertia(structure: int, free: np.ndarray) -> tuple:
    """Symmetric inertia about the centre of mass."""
    if structure == SYMM:
        return (free[0], free[1], free[2], free[3], free[4], free[5])
    if structure == TRI:
        first, second, third = _columns(free)
        j1, j2, j3, _, _ = _moments(free)
        xx, xy, xz, yy, yz, zz = _sandwiched(first, second, third, j1, j2, j3)
    else:
        l11, l22, l33, l21, l31, l32 = free[0], free[1], free[2], free[3], free[4], free[5]
        xx, xy, xz = l11 * l11 + INERTIA_BIAS, l11 * l21, l11 * l31
        yy, yz = l21 * l21 + l22 * l22 + INERTIA_BIAS, l21 * l31 + l22 * l32
        zz = l31 * l31 + l32 * l32 + l33 * l33 + INERTIA_BIAS
        if structure == COV:
            xx, xy, xz, yy, yz, zz = yy + zz, -xy, -xz, xx + zz, -yz, xx + yy
    margin = ROUNDING_MARGIN * (xx + yy + zz)
    return (xx + margin, xy, xz, yy + margin, yz, zz + margin)


@numba.njit(cache=True)
def _triangle_gradient(free: np.ndarray, slope: tuple, gradient: np.ndarray) -> None:
    first, second, third = _columns(free)
    j1, j2, j3, sine, angle = _moments(free)
    slope1, slope2 = _dot(first, _times(slope, first)), _dot(second, _times(slope, second))
    slope3 = _dot(third, _times(slope, third)) / j3
    gradient[3] = 2.0 * free[3] * (slope1 + slope3 * (j1 - j2 + 2.0 * j2 * sine * sine))
    gradient[4] = 2.0 * free[4] * (slope2 + slope3 * (j2 - j1 + 2.0 * j1 * sine * sine))
    share = angle / (0.5 * math.pi)
    inside = abs(free[5]) <= FLAT_SIGMOID
    turning = 4.0 * j1 * j2 * sine * math.cos(angle) * 0.5 * math.pi * share * (1.0 - share)
    gradient[5] = slope3 * turning if inside else 0.0

    inertia = _sandwiched(first, second, third, j1, j2, j3)
    # vee(2 G I): columns of I times those of G, as vectors
    ixx, ixy, ixz, iyy, iyz, izz = inertia
    gxx, gxy, gxz, gyy, gyz, gzz = slope
    a = cross((ixx, ixy, ixz), (gxx, gxy, gxz))
    b = cross((ixy, iyy, iyz), (gxy, gyy, gyz))
    c = cross((ixz, iyz, izz), (gxz, gyz, gzz))
    turn = (2.0 * (a[0] + b[0] + c[0]), 2.0 * (a[1] + b[1] + c[1]), 2.0 * (a[2] + b[2] + c[2]))
    vector = (free[0], free[1], free[2])
    size, sine, cosine = _angle(vector)
    rest = (1.0 - sine) / (size * size)
    once = cross(vector, turn)
    twice = cross(vector, once)
    for axis in range(3):
        gradient[axis] = turn[axis] - cosine * once[axis] + rest * twice[axis]


@numba.njit(cache=True, inline="always")
def _angle(vector: tuple) -> tuple:
    """Size a of a rotation vector, sin(a) / a and (1 - cos(a)) / a^2; also at zero."""
    size = math.sqrt(_dot(vector, vector) + 1e-30)
    half = math.sin(0.5 * size) / size
    return size, math.sin(size) / size, 2.0 * half * half


@numba.njit(cache=True)
def _columns(free: np.ndarray) -> tuple:
    """Columns of the rotation matrix: the principal axes."""
    x, y, z = free[0], free[1], free[2]
    _, sine, cosine = _angle((x, y, z))
    first = (1.0 - cosine * (y * y + z * z), sine * z + cosine * x * y, cosine * x * z - sine * y)
    second = (cosine * x * y - sine * z, 1.0 - cosine * (x * x + z * z), sine * x + cosine * y * z)
    third = (sine * y + cosine * x * z, cosine * y * z - sine * x, 1.0 - cosine * (x * x + y * y))
    return first, second, third


@numba.njit(cache=True)
def _moments(free: np.ndarray) -> tuple:
    """Principal moments (eq. III.9 to III.11), and the sine and size of half the triangle's angle."""
    first, second = free[3] * free[3] + INERTIA_BIAS, free[4] * free[4] + INERTIA_BIAS
    share = 1.0 / (1.0 + math.exp(-min(max(free[5], -FLAT_SIGMOID), FLAT_SIGMOID)))
    angle = 0.5 * math.pi * share
    sine = math.sin(angle)
    third = math.hypot(first - second, 2.0 * math.sqrt(first) * math.sqrt(second) * sine)
    return first, second, third, sine, angle


@numba.njit(cache=True, inline="always")
def _sandwiched(a: tuple, b: tuple, c: tuple, j1: float, j2: float, j3: float) -> tuple:
    """R J R^T of the columns a, b, c of R."""
    return (
        j1 * a[0] * a[0] + j2 * b[0] * b[0] + j3 * c[0] * c[0],
        j1 * a[0] * a[1] + j2 * b[0] * b[1] + j3 * c[0] * c[1],
        j1 * a[0] * a[2] + j2 * b[0] * b[2] + j3 * c[0] * c[2],
        j1 * a[1] * a[1] + j2 * b[1] * b[1] + j3 * c[1] * c[1],
        j1 * a[1] * a[2] + j2 * b[1] * b[2] + j3 * c[1] * c[2],
        j1 * a[2] * a[2] + j2 * b[2] * b[2] + j3 * c[2] * c[2],
    )


@numba.njit(cache=True, inline="always")
def _times(matrix: tuple, vector: tuple) -> tuple:
    """A symmetric matrix times a vector."""
    xx, xy, xz, yy, yz, zz = matrix
    x, y, z = vector
    return (xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)


@numba.njit(cache=True, inline="always")
def _dot(a: tuple, b: tuple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
