"""What an arm carries, from motions without it and the same motions with it.

    tau = Y theta + F phi            without
    tau = Y theta + F phi + Y_n l    with: l are the ten parameters of what the last link has gained

All is one least-squares problem, so that what the arm itself weighs need not be known; since both motions of
a pair go the same way, l rests on the difference of their torques. A joint's equations count by how well they
can be met: errors are divided by what is left of that joint, found by a first fit.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.ground.block_bootstrap import blocks, drawn_counts
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.identification import SINGULAR
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, triangular_factor
from structlearn.rigid_body.tree import KinematicTree

UNKNOWN = 1e-6
"""Directions of which a draw of blocks says less than this share of the best known are left at zero."""


def identify_load(
    tree: KinematicTree,
    pairs: Sequence[tuple[Motion, Motion]],
    friction: Sequence[FrictionTerm],
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Inertial parameters of a load at the last link.

    Args:
        tree: n joints.
        pairs: the same motion without the load and with it, in step; every pair, e.g. a day, has friction of
            its own, the arm and its load are the same.
        friction: terms.
        length: samples of a block of the bootstrap. What is drawn is a time of a pair, with both motions
            then: errors that come back whenever the arm passes there, such as friction's, cancel in part.
        draws: of the bootstrap.
        seed: of the draws.

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
    """(N, 2, n, P + 1) of a pair: columns of the links, of every pair's friction, of the load; the torque."""
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
