"""Identification of an arm from a log: least squares, and the best physically consistent model.

Torques are linear in theta, so the unconstrained optimum is a single least-squares problem. A physically
consistent structure (tri, cov) is fitted to the same data and loss by L-BFGS on its free parameters. The loss
is a quadratic form in theta (`regressor.torque_factors`), so the cost of an iteration does not depend on the
number of samples.

A planar arm without a URDF is identified together with its kinematics. For given positions of the joints on
their parent links, torques are linear in the inertial parameters; so only these positions are searched, and
least squares give the rest (variable projection). Gravity is known, which makes lengths come out in metres.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from structlearn.core.metrics import blocks, drawn_counts
from structlearn.core.parallel import parallel_map
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.friction import FrictionTerm, initial_friction, squared
from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    Structure,
    free_parameters,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import (
    SYMMETRIC_COLUMNS,
    MotionRegressor,
    TorqueFactors,
    torque_factors,
    triangular_factor,
)
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

SINGULAR = 1e-8
"""Directions of theta with a singular value below this share of the largest are set to zero."""

GRAVITY = 9.81  # m/s^2, of planar arms, along -y

ANCHOR = 1e-6
"""Weight of the relative squared change of theta, against the sum of the joints' NMSEs."""


def normalised_triangle(factors: TorqueFactors, limits: np.ndarray | None = None) -> np.ndarray:
    """Triangular factor (P + 1, P + 1) of all joints: |triangle (theta, -1)|^2 is the sum of their NMSEs.

    With `limits` (n,) N m, errors are instead relative to the joints' torque limits, scaled so that the total
    weight of the torques is unchanged.
    """
    squares = factors.variance
    if limits is not None:
        squares = limits**2 * np.mean(factors.variance / limits**2)
    scaled = factors.factors / np.sqrt(factors.samples * squares)[:, None, None]
    return triangular_factor(scaled.reshape(-1, scaled.shape[-1]))


def unconstrained_minimiser(triangle: np.ndarray) -> np.ndarray:
    """Unconstrained minimiser (P,) of the sum of the joints' NMSEs; the smallest if not unique."""
    theta, *_ = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=SINGULAR)
    return theta


def fit_structure(
    structure: Structure,
    triangle: np.ndarray,
    terms: Sequence[FrictionTerm],
    start: LinkInertias,
    iterations: int,
    known: LinkInertias | None = None,
    friction: np.ndarray | None = None,
    prior: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Fit a structure's free parameters to the loss of `unconstrained_minimiser`, by L-BFGS.

    A weak pull towards known inertias decides what the data leave undetermined. With a prior, `prior` times
    the links' mean `divergence` from the known inertias is added to the loss.

    Args:
        structure: parameterisation of the inertias.
        triangle: factor of the data; columns of the links (full ones for nostr), then of friction.
        terms: of friction.
        start: initial inertias (n,).
        iterations: maximum number.
        known: target of the pull; None: the start.
        friction: (1, n, t) initial free parameters of friction; None: small ones.
        prior: weight; 0 for structures whose inertias need not be physically consistent.

    Returns:
        Free parameters of the inertias (1, n, k) and of friction (1, n, t).
    """
    from scipy.optimize import minimize

    place, squares = STRUCTURES.index(structure), squared(terms)
    free = free_parameters(structure, start)[None].numpy()
    friction = initial_friction(1, len(start.mass), terms) if friction is None else friction
    pulled = free if known is None else free_parameters(structure, known)[None].numpy()
    reference = structure_theta(place, pulled, friction[..., :0], squares[:0])[0]
    weight = ANCHOR / (reference @ reference)
    factor, measured = triangle[:, :-1], triangle[:, -1]

    def parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inertial, frictional = np.split(values, [free.size])
        return inertial.reshape(free.shape), frictional.reshape(friction.shape)

    def loss(values: np.ndarray) -> tuple[float, np.ndarray]:
        theta = structure_theta(place, *parts(values), squares)
        error, pull = factor @ theta[0] - measured, theta[0, : len(reference)] - reference
        slope = 2.0 * (error @ factor)
        slope[: len(reference)] += 2.0 * weight * pull
        added = 0.0
        if prior:
            apart, change = divergence(theta[0, : len(reference)], reference)
            added = prior * apart.mean()
            slope[: len(reference)] += prior / len(apart) * change
        gradients = structure_gradient(place, *parts(values), squares, slope[None])
        value = error @ error + weight * (pull @ pull) + added
        return value, np.concatenate([gradient.ravel() for gradient in gradients])

    options = {"maxiter": iterations, "maxfun": 2 * iterations, "maxcor": 50, "ftol": 1e-14, "gtol": 1e-10}
    first = np.concatenate([free.ravel(), friction.ravel()])
    return parts(minimize(loss, first, jac=True, method="L-BFGS-B", options=options).x)


def divergence(theta: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log-det divergence of the links' pseudo-inertias from known ones (Lee, Wensing, Park 2020).

        D = tr(P0^-1 P) - log det(P0^-1 P) - 4        P = [[tr(I)/2 1 - I, h], [h^T, m]]

    It is convex in theta, independent of frames and units, and unbounded at the boundary of physically
    consistent inertias. Both theta (10 n,) must be physically consistent. Returns (n,) per link, and the
    gradient (10 n,) of the sum.
    """
    pseudo, reference = (
        links.reshape(-1, SYMMETRIC_COLUMNS) @ PSEUDO.reshape(SYMMETRIC_COLUMNS, 16)
        for links in (theta, known)
    )
    pseudo, inverse = pseudo.reshape(-1, 4, 4), np.linalg.inv(reference.reshape(-1, 4, 4))
    ratio = inverse @ pseudo
    apart = np.trace(ratio, axis1=1, axis2=2) - np.linalg.slogdet(ratio)[1] - 4.0
    slope = np.einsum("nij,kij->nk", inverse - np.linalg.inv(pseudo), PSEUDO)
    return apart, slope.ravel()


def _pseudo_columns() -> np.ndarray:
    """(10, 4, 4) derivative of the pseudo-inertia by each parameter of a link."""
    columns = np.zeros((SYMMETRIC_COLUMNS, 4, 4))
    columns[0, 3, 3] = 1.0
    for axis in range(3):
        columns[1 + axis, axis, 3] = columns[1 + axis, 3, axis] = 1.0
    for place, (row, column) in enumerate(zip(*np.triu_indices(3), strict=True)):
        entry = columns[4 + place]
        entry[row, column] = entry[column, row] = -1.0
        if row == column:
            entry[:3, :3] += 0.5 * np.eye(3)
    return columns


PSEUDO = _pseudo_columns()


def drawn_fits(
    model: DynamicsModels,
    regressor: MotionRegressor,
    known: LinkInertias,
    iterations: int,
    length: int,
    draws: int,
    seed: int,
) -> DynamicsModels:
    """Bootstrap of a structure's fit: `draws` models, each fitted to resampled blocks of `length` samples.

    Each fit starts from `model`, the fit to the whole motion (not nostr); `known` is the target of the weak
    pull.
    """
    whole = regressor.factors  # its number of samples and variances weight every block
    pieces = zip(blocks(regressor.columns, length), blocks(regressor.torque, length), strict=True)
    triangles = np.array(
        [normalised_triangle(replace(whole, factors=torque_factors(*piece).factors)) for piece in pieces]
    )
    drawn = [
        triangular_factor((np.sqrt(counts)[:, None, None] * triangles).reshape(-1, triangles.shape[-1]))
        for counts in drawn_counts(len(triangles), draws, seed)
    ]
    refit = partial(
        fit_structure,
        model.structure,
        terms=model.friction,
        start=model.inertias().of(0),
        iterations=iterations,
        known=known,
        friction=np.asarray(model.state["friction"]),
    )
    inertias, frictions = zip(*parallel_map(refit, drawn, "intervals of inertias"), strict=True)
    state = {"inertia": np.concatenate(inertias), "friction": np.concatenate(frictions)}
    return replace(model, state=state)


def planar_tree(places: np.ndarray) -> KinematicTree:
    """Kinematics of n joints about z; `places` (n - 1, 2) m: x and y of joints 2 to n on the parent link."""
    n = len(places) + 1
    translation = np.zeros((n, 3))
    translation[1:, :2] = places
    unlimited = np.full(n, np.inf)
    return KinematicTree(
        names=tuple(f"joint_{number}" for number in range(1, n + 1)),
        parents=np.arange(n) - 1,
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        translation=translation,
        axis=np.tile([0.0, 0.0, 1.0], (n, 1)),
        prismatic=np.zeros(n, dtype=bool),
        lower=-unlimited,
        upper=unlimited,
        velocity=unlimited,
        gravity=np.array([0.0, -GRAVITY, 0.0]),
    )


def fit_planar_arm(motion: Motion, iterations: int) -> tuple[KinematicTree, DynamicsModels]:
    """Identify a planar arm: joint positions by least squares, then consistent inertias (cov) by L-BFGS.

    Both start from links of 1 m and 1 kg; errors are weighted as in `normalised_triangle`.
    """
    from scipy.optimize import minimize

    joints = motion.joints

    def triangle(places: np.ndarray) -> np.ndarray:
        tree = planar_tree(places.reshape(-1, 2))
        return normalised_triangle(MotionRegressor(tree, motion, True, ()).factors)

    def error(places: np.ndarray) -> float:
        block = triangle(places)
        return float(np.linalg.norm(block[:, :-1] @ unconstrained_minimiser(block) - block[:, -1]))

    start = np.tile([1.0, 0.0], joints - 1)
    places = minimize(error, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).x
    bodies = LinkInertias(
        np.ones(joints), np.tile([0.5, 0.0, 0.0], (joints, 1)), np.tile(0.1 * np.eye(3), (joints, 1, 1))
    )
    free, friction = fit_structure("cov", triangle(places), (), bodies, iterations)
    tree = planar_tree(places.reshape(-1, 2))
    return tree, DynamicsModels("cov", tree.names, (), (), {"inertia": free, "friction": friction})
