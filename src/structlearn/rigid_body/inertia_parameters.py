"""Five parameterisations of a link's inertia (chapter III.3).

    nostr  m, h = m c, nine entries of I                                        (eq. III.3)
    symm   m = s^2 + b, h, six entries of a symmetric I                         (eq. III.4)
    spd    m = s^2 + b, h, I = L L^T + b 1                                      (eq. III.6)
    tri    m = s^2 + b, h, I = R J R^T, J from the sides of a triangle          (eq. III.7, III.8, III.12)
    cov    m = s^2 + b, h, I = tr(Sigma) 1 - Sigma, Sigma = L L^T + b 1         (eq. III.13 to III.16)

I is the rotational inertia about the centre of mass. Free parameters are unbounded real numbers, so gradient
descent needs no constraints. Every value of tri and cov is physically consistent: positive mass, positive
definite inertia, no principal moment above the sum of the other two.

`link_inertias` is differentiable by torch. `structure_theta` (parameters of the regressor's columns) and
`structure_gradient` (its reverse pass, in closed form) are compiled. With G the gradient by the inertia, as a
symmetric matrix,

    I = L L^T + b 1          dL = 2 G L                                           (spd; cov with tr(G) 1 - G)
    I = R J R^T              dJ = diag(R^T G R)     dv = Jl(v)^T vee(2 G I)       (tri)

where R = exp(v) and Jl is the left Jacobian of the rotation group. In compiled code, symmetric matrices are
tuples (xx, xy, xz, yy, yz, zz).
"""

import math
from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor

from structlearn.core.compilation import cross, numba
from structlearn.networks.torch_settings import square_root
from structlearn.rigid_body.tree import LinkInertias

Structure = Literal["nostr", "symm", "spd", "tri", "cov"]
STRUCTURES: tuple[Structure, ...] = get_args(Structure)

MASS_BIAS_KG = 0.01
INERTIA_BIAS = 1e-6  # kg m^2, a tenth of the inertia of a 10 g link of 10 cm
ROUNDING_MARGIN = 1e-12
"""Share of its trace that is added to an inertia's diagonal, so that physical consistency survives rounding
when the principal moments differ by orders of magnitude."""

INITIAL_MASS, INITIAL_FIRST_MOMENT, INITIAL_INERTIA = 1.0, 0.1, 0.01
"""Standard deviations of the initial free parameters, as in public code of the dissertation's group."""

FLAT_SIGMOID = 30.0  # beyond, the sigmoid of tri's angle is 0 or 1 to within 1e-13
_FROM_BOUND, _FLATTEST = 1e-6, 0.999
"""Least distance of known inertias from the bounds (relative to their size; tri's angle as a share of pi),
since the gradient vanishes at a bound. This changes an inertia by about 1e-6 of its size."""


def parameter_count(structure: Structure) -> int:
    """Number of free parameters per link: 13 for nostr, 10 for the others."""
    return 13 if structure == "nostr" else 10


def sample_parameters(structure: Structure, links: int, generators: list[torch.Generator]) -> Tensor:
    """Initial free parameters (M, links, k) of M models, one generator each: float64, zero-mean normal."""
    deviations = torch.full((parameter_count(structure),), INITIAL_INERTIA, dtype=torch.float64)
    deviations[0] = INITIAL_MASS
    deviations[1:4] = INITIAL_FIRST_MOMENT
    shape = (links, len(deviations))
    drawn = [torch.randn(shape, dtype=torch.float64, generator=generator) for generator in generators]
    return torch.stack(drawn) * deviations


def link_inertias(structure: Structure, free: Tensor) -> LinkInertias[Tensor]:
    """Inertial parameters for free parameters (..., n, k), differentiable.

    `free` must be finite float64: the guarantees of spd, tri and cov do not hold in single precision.
    """
    scalar, first_moment, rotational = free[..., 0], free[..., 1:4], free[..., 4:]
    mass = scalar if structure == "nostr" else scalar.square() + MASS_BIAS_KG
    return LinkInertias(mass, first_moment, _INERTIAS[structure](rotational))


def free_parameters(structure: Structure, inertias: LinkInertias) -> Tensor:
    """Free parameters (..., n, k) that express given inertias, mass (..., n), e.g. to start training there.

    Inertias that a structure cannot express (a link lighter than the bias; for tri and cov, an inconsistent
    tensor, as in some URDFs) are replaced by nearby ones: eigenvalues are moved inside the bounds.
    """
    known = inertias.arrays()
    scalar = known.mass
    if structure != "nostr":
        scalar = np.sqrt(np.maximum(known.mass - MASS_BIAS_KG, _FROM_BOUND * np.abs(known.mass)))
    parts = [scalar[..., None], known.first_moment, _FREE[structure](known.inertia)]
    return torch.from_numpy(np.concatenate(parts, axis=-1))


def _triangular(free: Tensor) -> Tensor:
    """Principal moments from two sides of a triangle and the angle between them (eq. III.9 to III.11)."""
    rotation = _exponential(free[..., :3])
    first, second = (free[..., 3:5].square() + INERTIA_BIAS).unbind(-1)
    half_angle = 0.5 * torch.pi * torch.sigmoid(free[..., 5].clamp(-FLAT_SIGMOID, FLAT_SIGMOID))
    # law of cosines without differences of large squares: J3^2 = (J1 - J2)^2 + 4 J1 J2 sin^2(a / 2)
    third = torch.hypot(first - second, 2.0 * (square_root(first) * square_root(second)) * half_angle.sin())
    moments = torch.stack([first, second, third], dim=-1)
    inertia = rotation * moments[..., None, :] @ rotation.mT
    return _with_margin(0.5 * (inertia + inertia.mT))


def _covariance(free: Tensor) -> Tensor:
    second_moment = _biased_product(free)
    identity = torch.eye(3, dtype=free.dtype)
    return _with_margin(_trace(second_moment) * identity - second_moment)


_SYMMETRIC_ENTRIES = (0, 1, 2, 1, 3, 4, 2, 4, 5)
"""Index among xx, xy, xz, yy, yz, zz of each entry of a 3 x 3 matrix, row by row."""

_INERTIAS = {
    "nostr": lambda free: free.unflatten(-1, (3, 3)),
    "symm": lambda free: free[..., _SYMMETRIC_ENTRIES].unflatten(-1, (3, 3)),
    "spd": lambda free: _with_margin(_biased_product(free)),
    "tri": _triangular,
    "cov": _covariance,
}


def _biased_product(free: Tensor) -> Tensor:
    """L L^T + b 1 with free = (L11, L22, L33, L21, L31, L32) (eq. III.5)."""
    zero = torch.zeros_like(free[..., 0])
    l11, l22, l33, l21, l31, l32 = free.unbind(-1)
    lower = torch.stack([l11, zero, zero, l21, l22, zero, l31, l32, l33], dim=-1).unflatten(-1, (3, 3))
    return lower @ lower.mT + INERTIA_BIAS * torch.eye(3, dtype=free.dtype)


def _exponential(vector: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), differentiable at zero."""
    angle = square_root(vector.square().sum(-1) + 1e-30)[..., None, None]
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    skew = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).unflatten(-1, (3, 3))
    sine = torch.sinc(angle / torch.pi)  # sin(angle) / angle
    cosine = 0.5 * torch.sinc(angle / (2.0 * torch.pi)).square()  # (1 - cos(angle)) / angle^2
    return torch.eye(3, dtype=vector.dtype) + sine * skew + cosine * (skew @ skew)


def _trace(matrix: Tensor) -> Tensor:
    return matrix.diagonal(dim1=-2, dim2=-1).sum(-1)[..., None, None]


def _with_margin(inertia: Tensor) -> Tensor:
    return inertia + ROUNDING_MARGIN * _trace(inertia) * torch.eye(3, dtype=inertia.dtype)


def _symmetric(inertia: np.ndarray) -> np.ndarray:
    return 0.5 * (inertia + np.swapaxes(inertia, -1, -2))


def _free_positive_definite(inertia: np.ndarray) -> np.ndarray:
    """Cholesky factor of I - b 1, or of the nearest positive definite matrix."""
    values, vectors = np.linalg.eigh(_symmetric(inertia))
    values = np.maximum(values - INERTIA_BIAS, _FROM_BOUND * np.abs(values).max(axis=-1, keepdims=True))
    lower = np.linalg.cholesky((vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2))
    return lower[..., [0, 1, 2, 1, 2, 2], [0, 1, 2, 0, 0, 1]]


def _free_covariance(inertia: np.ndarray) -> np.ndarray:
    trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
    return _free_positive_definite(0.5 * trace * np.eye(3) - inertia)


def _free_triangular(inertia: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    moments, rotation = np.linalg.eigh(_symmetric(inertia))
    rotation = rotation * np.sign(np.linalg.det(rotation))[..., None, None]
    moments = np.maximum(moments, 2.0 * INERTIA_BIAS)
    first, second, third = np.moveaxis(moments, -1, 0)  # ascending
    # tan^2 of half the angle between the two sides, without differences of squares
    opposite = (third - first + second) * (third + first - second)
    adjacent = np.maximum(first + second - third, 0.0) * (first + second + third)
    angle = 2.0 * np.arctan2(np.sqrt(opposite), np.sqrt(adjacent))
    share = np.minimum(angle / np.pi, _FLATTEST)
    vectors = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec().reshape(moments.shape)
    sides, angles = np.sqrt(moments[..., :2] - INERTIA_BIAS), np.log(share / (1.0 - share))[..., None]
    return np.concatenate([vectors, sides, angles], axis=-1)


_FREE = {
    "nostr": lambda inertia: inertia.reshape(*inertia.shape[:-2], 9),
    "symm": lambda inertia: _symmetric(inertia)[..., *np.triu_indices(3)],
    "spd": _free_positive_definite,
    "tri": _free_triangular,
    "cov": _free_covariance,
}


NOSTR, SYMM, SPD, TRI, COV = range(len(STRUCTURES))
"""Indices in `STRUCTURES`, by which compiled code selects a structure."""


@numba.njit(cache=True)
def structure_theta(
    structure: int, free: np.ndarray, friction: np.ndarray, squared: np.ndarray
) -> np.ndarray:
    """Parameters theta of the regressor's columns: (M, 10 n + t n), for nostr (M, 13 n + t n).

    `structure` is an index in `STRUCTURES`; `free` (M, n, k) and `friction` (M, n, t) are free parameters of
    inertias and friction; `squared` (t,) marks friction terms that are squares of their free parameter.
    """
    models, links, width = free.shape
    terms = len(squared)
    theta = np.empty((models, links * (width + terms)))
    for model in range(models):
        for link in range(links):
            _link_theta(structure, free[model, link], theta[model, link * width : (link + 1) * width])
            for term in range(terms):
                value = friction[model, link, term]
                place = links * width + link * terms + term
                theta[model, place] = value * value if squared[term] else value
    return theta


@numba.njit(cache=True)
def structure_gradient(
    structure: int, free: np.ndarray, friction: np.ndarray, squared: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradients (M, n, k) and (M, n, t) by `free` and `friction`, from the gradient (M, P) by theta."""
    models, links, width = free.shape
    terms = len(squared)
    inertial, frictional = np.empty_like(free), np.empty_like(friction)
    for model in range(models):
        for link in range(links):
            columns = slope[model, link * width : (link + 1) * width]
            _link_gradient(structure, free[model, link], columns, inertial[model, link])
            for term in range(terms):
                value = slope[model, links * width + link * terms + term]
                frictional[model, link, term] = (
                    2.0 * friction[model, link, term] * value if squared[term] else value
                )
    return inertial, frictional


@numba.njit(cache=True)
def _link_theta(structure: int, free: np.ndarray, theta: np.ndarray) -> None:
    """Mass, first moment, and inertia about the joint origin: I + (|h|^2 1 - h h^T) / m."""
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
    """Reverse pass of `_link_theta`."""
    mass = free[0] if structure == NOSTR else free[0] * free[0] + MASS_BIAS_KG
    if structure == NOSTR:
        xx, yy, zz = slope[4], slope[8], slope[12]
        xy, xz, yz = slope[5] + slope[7], slope[6] + slope[10], slope[9] + slope[11]
    else:
        xx, xy, xz, yy, yz, zz = slope[4], slope[5], slope[6], slope[7], slope[8], slope[9]
    xy, xz, yz = 0.5 * xy, 0.5 * xz, 0.5 * yz
    first_moment = (free[1], free[2], free[3])
    turned = _times((xx, xy, xz, yy, yz, zz), first_moment)
    trace = xx + yy + zz
    for axis in range(3):
        gradient[1 + axis] = slope[1 + axis] + 2.0 * (trace * first_moment[axis] - turned[axis]) / mass
    shift = trace * _dot(first_moment, first_moment) - _dot(first_moment, turned)
    lighter = slope[0] - shift / (mass * mass)
    gradient[0] = lighter if structure == NOSTR else 2.0 * free[0] * lighter
    if structure in (NOSTR, SYMM):
        gradient[4:] = slope[4:]
        return
    margin = ROUNDING_MARGIN * trace
    xx, yy, zz = xx + margin, yy + margin, zz + margin
    if structure == COV:  # gradient of tr(S) 1 - S by S
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
    # vee(2 G I): cross products of the columns of I and G
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
    """Angle a of a rotation vector, sin(a) / a and (1 - cos(a)) / a^2; valid at zero."""
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
    """Principal moments (eq. III.9 to III.11), and sine and value of half the triangle's angle."""
    first, second = free[3] * free[3] + INERTIA_BIAS, free[4] * free[4] + INERTIA_BIAS
    share = 1.0 / (1.0 + math.exp(-min(max(free[5], -FLAT_SIGMOID), FLAT_SIGMOID)))
    angle = 0.5 * math.pi * share
    sine = math.sin(angle)
    third = math.hypot(first - second, 2.0 * math.sqrt(first) * math.sqrt(second) * sine)
    return first, second, third, sine, angle


@numba.njit(cache=True, inline="always")
def _sandwiched(a: tuple, b: tuple, c: tuple, j1: float, j2: float, j3: float) -> tuple:
    """R J R^T for a rotation R with columns a, b, c."""
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
