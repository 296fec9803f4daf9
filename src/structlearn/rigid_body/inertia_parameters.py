"""Five parameterisations of a link's inertia (chapter III.3).

    nostr  m, h = m c, nine entries of I                                        (eq. III.3)
    symm   m = s^2 + b, h, six entries of a symmetric I                         (eq. III.4)
    spd    m = s^2 + b, h, I = L L^T + b 1                                      (eq. III.6)
    tri    m = s^2 + b, h, I = R J R^T, J from the sides of a triangle          (eq. III.7, III.8, III.12)
    cov    m = s^2 + b, h, I = tr(Sigma) 1 - Sigma, Sigma = L L^T + b 1         (eq. III.13 to III.16)

I is the rotational inertia about the centre of mass. Free parameters are real numbers without bounds, so
gradient descent needs no constraint. Every value of tri and cov is physically consistent: positive mass,
positive definite inertia, no principal moment above the sum of the other two.
"""

from typing import Literal, get_args

import numpy as np
import torch
from torch import Tensor

from structlearn.rigid_body.tree import LinkInertias

Structure = Literal["nostr", "symm", "spd", "tri", "cov"]
STRUCTURES: tuple[Structure, ...] = get_args(Structure)

MASS_BIAS_KG = 0.01
INERTIA_BIAS = 1e-6  # kg m^2, a tenth of what a 10 g link of 10 cm has
ROUNDING_MARGIN = 1e-12
"""Share of its trace that is added to an inertia's diagonal, so that what holds for real numbers survives
rounding when the principal moments are of very different size."""

INITIAL_MASS, INITIAL_FIRST_MOMENT, INITIAL_INERTIA = 1.0, 0.1, 0.01
"""Standard deviations of the free parameters at the start, as in public code of the dissertation's group."""

FLAT_SIGMOID = 30.0  # beyond, the sigmoid of tri's angle is 0 or 1 to 1e-13
_FROM_BOUND, _FLATTEST = 1e-6, 0.999
"""Known inertias start at least so far inside the bounds (share of their size; tri's angle in pi), since the
gradient vanishes at a bound itself. The inertia is changed by some 1e-6 of itself."""


def parameter_count(structure: Structure) -> int:
    """Free parameters of one link: 13 for nostr, 10 for the others."""
    return 13 if structure == "nostr" else 10


def draw(structure: Structure, links: int, generators: list[torch.Generator]) -> Tensor:
    """Initial free parameters (M, links, k) of M models, one generator each: float64, normal, about zero."""
    deviations = torch.full((parameter_count(structure),), INITIAL_INERTIA, dtype=torch.float64)
    deviations[0] = INITIAL_MASS
    deviations[1:4] = INITIAL_FIRST_MOMENT
    shape = (links, len(deviations))
    drawn = [torch.randn(shape, dtype=torch.float64, generator=generator) for generator in generators]
    return torch.stack(drawn) * deviations


def link_inertias(structure: Structure, free: Tensor) -> LinkInertias[Tensor]:
    """Inertial parameters that free parameters (..., n, k) stand for; differentiable.

    Of finite float64: the guarantees of spd, tri and cov are lost in single precision.
    """
    scalar, first_moment, rotational = free[..., 0], free[..., 1:4], free[..., 4:]
    mass = scalar if structure == "nostr" else scalar.square() + MASS_BIAS_KG
    return LinkInertias(mass, first_moment, _INERTIAS[structure](rotational))


def free_parameters(structure: Structure, inertias: LinkInertias) -> Tensor:
    """Free parameters (..., n, k) that stand for given inertias, mass (..., n), to start a training there.

    What a structure cannot express (a link lighter than the bias, or for tri and cov a tensor that no body
    has, as in some URDFs) becomes a near one that it can: eigenvalues are moved inside the bounds.
    """
    known = inertias.arrays()
    scalar = known.mass
    if structure != "nostr":
        scalar = np.sqrt(np.maximum(known.mass - MASS_BIAS_KG, _FROM_BOUND * np.abs(known.mass)))
    parts = [scalar[..., None], known.first_moment, _FREE[structure](known.inertia)]
    return torch.from_numpy(np.concatenate(parts, axis=-1))


def _unstructured(free: Tensor) -> Tensor:
    return free.unflatten(-1, (3, 3))


def _symmetric(free: Tensor) -> Tensor:
    return free[..., _SYMMETRIC_ENTRIES].unflatten(-1, (3, 3))


def _positive_definite(free: Tensor) -> Tensor:
    return _with_margin(_biased_product(free))


def _triangular(free: Tensor) -> Tensor:
    """Principal moments from two sides of a triangle and the angle between them (eq. III.9 to III.11)."""
    rotation = _exponential(free[..., :3])
    first, second = (free[..., 3:5].square() + INERTIA_BIAS).unbind(-1)
    half_angle = 0.5 * torch.pi * torch.sigmoid(free[..., 5].clamp(-FLAT_SIGMOID, FLAT_SIGMOID))
    # the law of cosines without the difference of large squares: J3^2 = (J1 - J2)^2 + 4 J1 J2 sin^2(a / 2)
    third = torch.hypot(first - second, 2.0 * (first.sqrt() * second.sqrt()) * half_angle.sin())
    moments = torch.stack([first, second, third], dim=-1)
    return _with_margin(_symmetrised(rotation * moments[..., None, :] @ rotation.mT))


def _covariance(free: Tensor) -> Tensor:
    second_moment = _biased_product(free)
    identity = torch.eye(3, dtype=free.dtype)
    return _with_margin(_trace(second_moment) * identity - second_moment)


_INERTIAS = {
    "nostr": _unstructured,
    "symm": _symmetric,
    "spd": _positive_definite,
    "tri": _triangular,
    "cov": _covariance,
}
_SYMMETRIC_ENTRIES = [0, 1, 2, 1, 3, 4, 2, 4, 5]
"""Of xx, xy, xz, yy, yz, zz in a 3 x 3 matrix row by row."""


def _biased_product(free: Tensor) -> Tensor:
    """L L^T + b 1 with free = (L11, L22, L33, L21, L31, L32) (eq. III.5)."""
    zero = torch.zeros_like(free[..., 0])
    l11, l22, l33, l21, l31, l32 = free.unbind(-1)
    lower = torch.stack([l11, zero, zero, l21, l22, zero, l31, l32, l33], dim=-1).unflatten(-1, (3, 3))
    return lower @ lower.mT + INERTIA_BIAS * torch.eye(3, dtype=free.dtype)


def _exponential(vector: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), with gradients also at zero."""
    angle = (vector.square().sum(-1) + 1e-30).sqrt()[..., None, None]
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    skew = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).unflatten(-1, (3, 3))
    sine = torch.sinc(angle / torch.pi)  # sin(angle) / angle
    cosine = 0.5 * torch.sinc(angle / (2.0 * torch.pi)).square()  # (1 - cos(angle)) / angle^2
    return torch.eye(3, dtype=vector.dtype) + sine * skew + cosine * (skew @ skew)


def _trace(matrix: Tensor) -> Tensor:
    return matrix.diagonal(dim1=-2, dim2=-1).sum(-1)[..., None, None]


def _symmetrised(matrix: Tensor) -> Tensor:
    return 0.5 * (matrix + matrix.mT)


def _with_margin(inertia: Tensor) -> Tensor:
    return inertia + ROUNDING_MARGIN * _trace(inertia) * torch.eye(3, dtype=inertia.dtype)


def _free_unstructured(inertia: np.ndarray) -> np.ndarray:
    return inertia.reshape(*inertia.shape[:-2], 9)


def _free_symmetric(inertia: np.ndarray) -> np.ndarray:
    rows, columns = np.triu_indices(3)
    return 0.5 * (inertia + np.swapaxes(inertia, -1, -2))[..., rows, columns]


def _free_positive_definite(inertia: np.ndarray) -> np.ndarray:
    """Cholesky factor of I - b 1, or of the nearest matrix that has one."""
    values, vectors = np.linalg.eigh(0.5 * (inertia + np.swapaxes(inertia, -1, -2)))
    values = np.maximum(values - INERTIA_BIAS, _FROM_BOUND * np.abs(values).max(axis=-1, keepdims=True))
    lower = np.linalg.cholesky((vectors * values[..., None, :]) @ np.swapaxes(vectors, -1, -2))
    return lower[..., [0, 1, 2, 1, 2, 2], [0, 1, 2, 0, 0, 1]]


def _free_covariance(inertia: np.ndarray) -> np.ndarray:
    trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
    return _free_positive_definite(0.5 * trace * np.eye(3) - inertia)


def _free_triangular(inertia: np.ndarray) -> np.ndarray:
    moments, rotation = np.linalg.eigh(0.5 * (inertia + np.swapaxes(inertia, -1, -2)))
    rotation = rotation * np.sign(np.linalg.det(rotation))[..., None, None]
    moments = np.maximum(moments, 2.0 * INERTIA_BIAS)
    first, second, third = np.moveaxis(moments, -1, 0)  # ascending
    # tan^2 of half the angle between two sides, without differences of squares
    opposite = (third - first + second) * (third + first - second)
    adjacent = np.maximum(first + second - third, 0.0) * (first + second + third)
    angle = 2.0 * np.arctan2(np.sqrt(opposite), np.sqrt(adjacent))
    share = np.minimum(angle / np.pi, _FLATTEST)
    free = [_rotation_vectors(rotation), np.sqrt(moments[..., :2] - INERTIA_BIAS)]
    return np.concatenate([*free, np.log(share / (1.0 - share))[..., None]], axis=-1)


def _rotation_vectors(rotation: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    vectors = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(rotation.shape[:-1])


_FREE = {
    "nostr": _free_unstructured,
    "symm": _free_symmetric,
    "spd": _free_positive_definite,
    "tri": _free_triangular,
    "cov": _free_covariance,
}
