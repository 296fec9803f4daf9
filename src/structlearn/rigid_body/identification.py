"""Identification from a log: least squares, the best model among those that can exist, and a carried load.

Torques are linear in theta, so the unconstrained optimum is one least-squares problem. A physically
consistent structure (tri, cov) is fitted to the same data and loss by L-BFGS on its free parameters; the loss
is a quadratic form of theta (`regressor.torque_factors`), so that an iteration does not touch the data.

A load shows in motions without it and the same motions with it:

    tau = Y theta + F phi            without
    tau = Y theta + F phi + Y_n l    with: l are the ten parameters of what the last link has gained

All is one least-squares problem, so that what the arm itself weighs need not be known; since both motions of
a pair go the same way, l rests on the difference of their torques. A joint's equations count by how well they
can be met: errors are divided by what is left of that joint, found by a first fit.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from structlearn.core.metrics import blocks, drawn_counts
from structlearn.core.parallel import parallel_map
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.inertia_learner import MotionRegressor, initial_friction, squared
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
    TorqueFactors,
    torque_factors,
    triangular_factor,
)
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

SINGULAR = 1e-8
"""Directions of theta that the data excite by less than this share of the strongest are left at zero."""

UNKNOWN = 1e-6
"""Directions of which a draw of blocks says less than this share of the best known are left at zero."""

ANCHOR = 1e-6
"""Weight of the squared change of theta, relative to all of it, against the sum of the joints' NMSEs."""


def normalised_triangle(factors: TorqueFactors, limits: np.ndarray | None = None) -> np.ndarray:
    """One triangular factor (P + 1, P + 1) of all joints: |triangle (theta, -1)|^2 is their NMSEs' sum.

    With `limits` (n,) N m of the joints' torques, errors count as shares of these instead, and all torques
    together weigh as much as before.
    """
    squares = factors.variance
    if limits is not None:
        squares = limits**2 * np.mean(factors.variance / limits**2)
    scaled = factors.factors / np.sqrt(factors.samples * squares)[:, None, None]
    return triangular_factor(scaled.reshape(-1, scaled.shape[-1]))


def least_squares(triangle: np.ndarray) -> np.ndarray:
    """Unconstrained optimum (P,) of the sum of the joints' NMSEs.

    Of the many optima (not every parameter shows in the torques) it is the smallest.
    """
    theta, *_ = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=SINGULAR)
    return theta


def fit_structure(
    structure: Structure,
    triangle: np.ndarray,
    friction: Sequence[FrictionTerm],
    start: LinkInertias,
    iterations: int,
    known: LinkInertias | None = None,
    rubbing: np.ndarray | None = None,
    prior: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """The structure's best parameters for the same loss as `least_squares`, by L-BFGS.

    A weak pull towards known inertias decides what the data leave open; with a prior, `prior` times the mean
    of the links' `divergence` from them is added to the loss.

    Args:
        structure: of the inertias.
        triangle: of the data; columns of the links (full ones for nostr), then of friction.
        friction: its terms.
        start: inertias (n,) to start from.
        iterations: at most so many.
        known: where the pull goes; None: to the start.
        rubbing: (1, n, t) free parameters of friction to start from; None: small ones.
        prior: weight; 0 for structures whose inertias need not be physically consistent.

    Returns:
        Free parameters of the inertias (1, n, k) and of friction (1, n, t).
    """
    from scipy.optimize import minimize

    place, squares = STRUCTURES.index(structure), squared(friction)
    free = free_parameters(structure, start)[None].numpy()
    rubbing = initial_friction(1, len(start.mass), friction) if rubbing is None else rubbing
    pulled = free if known is None else free_parameters(structure, known)[None].numpy()
    reference = structure_theta(place, pulled, rubbing[..., :0], squares[:0])[0]
    weight = ANCHOR / (reference @ reference)
    factor, measured = triangle[:, :-1], triangle[:, -1]

    def parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inertial, rubbed = np.split(values, [free.size])
        return inertial.reshape(free.shape), rubbed.reshape(rubbing.shape)

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
        return value, np.concatenate([its.ravel() for its in gradients])

    options = {"maxiter": iterations, "maxfun": 2 * iterations, "maxcor": 50, "ftol": 1e-14, "gtol": 1e-10}
    first = np.concatenate([free.ravel(), rubbing.ravel()])
    return parts(minimize(loss, first, jac=True, method="L-BFGS-B", options=options).x)


def divergence(theta: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log-det divergence of the links' pseudo-inertias from known ones (Lee, Wensing, Park 2020).

        D = tr(P0^-1 P) - log det(P0^-1 P) - 4        P = [[tr(I)/2 1 - I, h], [h^T, m]]

    It is convex in theta, does not depend on frames or units, and grows without bound towards inertias that
    no body has.

    Of theta (10 n,) and known (10 n,), both of physically consistent links: (n,) of the links, and the slope
    (10 n,) of their sum.
    """
    found, reference = (
        its.reshape(-1, SYMMETRIC_COLUMNS) @ PSEUDO.reshape(SYMMETRIC_COLUMNS, 16) for its in (theta, known)
    )
    found, inverse = found.reshape(-1, 4, 4), np.linalg.inv(reference.reshape(-1, 4, 4))
    ratio = inverse @ found
    apart = np.trace(ratio, axis1=1, axis2=2) - np.linalg.slogdet(ratio)[1] - 4.0
    slope = np.einsum("nij,kij->nk", inverse - np.linalg.inv(found), PSEUDO)
    return apart, slope.ravel()


def _pseudo_columns() -> np.ndarray:
    """(10, 4, 4): by what each column of a link enters its pseudo-inertia."""
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
    """Fits of a structure to blocks of `length` samples, drawn with replacement: `draws` models.

    Each starts from `model`, the fit to the whole motion, of a structure other than nostr; `known` is where
    the weak pull goes.
    """
    whole = regressor.factors  # whose number of samples and variances weight every block
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
        friction=model.friction,
        start=model.inertias().of(0),
        iterations=iterations,
        known=known,
        rubbing=np.asarray(model.state["friction"]),
    )
    inertias, frictions = zip(*parallel_map(refit, drawn, "intervals of inertias"), strict=True)
    state = {"inertia": np.concatenate(inertias), "friction": np.concatenate(frictions)}
    return replace(model, state=state)


def identify_load(
    tree: KinematicTree,
    pairs: Sequence[tuple[Motion, Motion]],
    friction: Sequence[FrictionTerm],
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Inertial parameters of a load at the last link.

    A pair is the same motion without the load and with it, in step; every pair, e.g. a day, has friction of
    its own. The bootstrap draws blocks of `length` samples of a pair, with both motions then: errors that
    come back whenever the arm passes there, such as friction's, cancel in part.

    Returns:
        (10,) mass in kg, first moment in kg m and inertia about the joint's origin in kg m^2 (xx, xy, xz, yy,
        yz, zz), in the last joint's frame; and (draws, 10).
    """
    rows = [_rows(tree, pair, friction, place, len(pairs)) for place, pair in enumerate(pairs)]
    joints = len(tree.names)
    measured = np.concatenate([its[..., -1].reshape(-1, joints) for its in rows])
    theta, _ = _solved(rows, 1.0 / np.sqrt(measured.var(axis=0)))
    left = np.concatenate([(its[..., :-1] @ theta - its[..., -1]).reshape(-1, joints) for its in rows])
    weights = 1.0 / np.sqrt((left**2).mean(axis=0))
    theta, directions = _solved(rows, weights)
    known = np.zeros(())
    for place, its in enumerate(rows):
        scaled = its * weights[:, None]
        reduced = np.concatenate([scaled[..., :-1] @ directions, scaled[..., -1:]], axis=-1)
        pieces = [piece.reshape(-1, piece.shape[-1]) for piece in blocks(reduced, length)]
        products = np.array([piece.T @ piece for piece in pieces])
        counts = drawn_counts(len(products), draws, seed + place)
        known = known + np.tensordot(counts, products, 1)
    inverse = np.linalg.pinv(known[:, :-1, :-1], rcond=UNKNOWN, hermitian=True)
    drawn = (inverse @ known[:, :-1, -1:])[..., 0] @ directions.T
    return theta[-SYMMETRIC_COLUMNS:], drawn[:, -SYMMETRIC_COLUMNS:]


def _rows(
    tree: KinematicTree,
    pair: tuple[Motion, Motion],
    friction: Sequence[FrictionTerm],
    place: int,
    pairs: int,
) -> np.ndarray:
    """(N, 2, n, P + 1) of a pair: columns of links, of every pair's friction, of the load; torque."""
    links = SYMMETRIC_COLUMNS * len(tree.names)
    parts = []
    for carries, motion in enumerate(pair):
        its = MotionRegressor(tree, motion.part(slice(None, min(map(len, pair)))), True, friction)
        rubbing = its.columns[..., links:]
        others = [rubbing if other == place else np.zeros_like(rubbing) for other in range(pairs)]
        gained = carries * its.columns[..., links - SYMMETRIC_COLUMNS : links]
        columns = [its.columns[..., :links], *others, gained, its.torque[..., None]]
        parts.append(np.concatenate(columns, axis=-1))
    return np.stack(parts, axis=1)


def _solved(rows: Sequence[np.ndarray], weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares (P,), the smallest of them, and directions (P, r) along which the squares are one."""
    stacked = np.concatenate([(its * weights[:, None]).reshape(-1, its.shape[-1]) for its in rows])
    triangle = triangular_factor(stacked)
    left, strength, right = np.linalg.svd(triangle[:, :-1], full_matrices=False)
    known = strength > SINGULAR * strength[0]
    directions = right[known].T / strength[known]
    return directions @ (left[:, known].T @ triangle[:, -1]), directions
