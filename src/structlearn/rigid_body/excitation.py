"""How well a motion tells base parameters: condition number, values and intervals (Gautier 1992)."""

from dataclasses import dataclass

import numpy as np

from structlearn.ground.block_bootstrap import block_sums, blocks, drawn_counts, percentiles
from structlearn.rigid_body.base_parameters import BaseParameters
from structlearn.rigid_body.friction import FrictionTerm, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.tree import KinematicTree

SINGULAR = 1e-10
"""Directions excited by less than this share of the strongest (of squares) are left at zero."""


@dataclass(frozen=True)
class BaseFit:
    """Least squares of base parameters and friction.

    Attributes:
        condition: ratio of the largest to the least singular value, columns scaled to unit length; infinite
            where something does not show at all.
        parameters: (r,) base parameters, SI units.
        low: (r,) lower end of the 95 % interval.
        high: (r,) upper end.
    """

    condition: float
    parameters: np.ndarray
    low: np.ndarray
    high: np.ndarray


def fit_base(
    tree: KinematicTree,
    base: BaseParameters,
    motion: Motion,
    friction: tuple[FrictionTerm, ...],
    length: int,
    draws: int,
    seed: int,
) -> BaseFit:
    """Fit base parameters to a motion; every joint's error counts over the variance of its torque.

    Args:
        tree: the robot.
        base: its base parameters.
        motion: N samples.
        friction: terms that are fitted beside them.
        length: samples of a block of the bootstrap.
        draws: of blocks.
        seed: of the draws.
    """
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd)[..., base.columns]
    columns = np.concatenate([columns, friction_regressor(motion.qd, friction)], axis=-1)
    weight = 1.0 / np.sqrt(motion.torque_variance)[:, None]
    columns, torque = weight * columns, weight[:, 0] * motion.torque  # (N, n, r), (N, n)
    scale = np.sqrt(np.square(columns).sum(axis=(0, 1)))
    shows = scale > 0.0
    columns = columns / np.where(shows, scale, 1.0)
    squares = np.array([np.tensordot(its, its, ((0, 1), (0, 1))) for its in blocks(columns, length)])
    products = block_sums(np.einsum("njp,nj->np", columns, torque), length)
    counts = np.vstack([np.ones(len(squares)), drawn_counts(len(squares), draws, seed)])
    inverse = np.linalg.pinv(np.tensordot(counts, squares, 1), rcond=SINGULAR, hermitian=True)
    found = np.einsum("dpq,dq->dp", inverse, counts @ products) / np.where(shows, scale, 1.0)
    singular = np.linalg.svd(columns.reshape(-1, columns.shape[-1]), compute_uv=False)
    condition = singular[0] / singular[-1] if singular[-1] > 0.0 else np.inf
    values = found[:, : len(base.columns)]
    return BaseFit(float(condition), values[0], *percentiles(values[1:]))
