"""How far identified inertias can be trusted: the same fit on blocks of the motion drawn anew."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from structlearn.ground.block_bootstrap import blocks, drawn_counts
from structlearn.ground.parallel import parallel_map
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.identification import fit_structure, normalised_triangle
from structlearn.rigid_body.inertia_parameters import Structure
from structlearn.rigid_body.structured_learning import MotionRegressor
from structlearn.rigid_body.torque_factors import torque_factors
from structlearn.rigid_body.tree import LinkInertias


def drawn_fits(
    structure: Structure,
    regressor: MotionRegressor,
    start: LinkInertias,
    known: LinkInertias,
    iterations: int,
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Fits of a structure to blocks of a motion, drawn with replacement.

    Args:
        structure: of the inertias, not nostr.
        regressor: of the motion, with the terms of friction.
        start: inertias (n,) to start from, those of the fit to the whole motion.
        known: where the weak pull goes that decides what the data leave open.
        iterations: of L-BFGS per draw.
        length: samples of a block.
        draws: of the bootstrap.
        seed: of the draws.

    Returns:
        Free parameters of the inertias (draws, n, k) and of friction (draws, n, t).
    """
    whole = regressor.factors  # whose number of samples and variances weight every block
    triangles = np.array(
        [
            normalised_triangle(replace(whole, factors=torque_factors(columns, torque).factors))
            for columns, torque in zip(
                blocks(regressor.columns, length), blocks(regressor.torque, length), strict=True
            )
        ]
    )
    width = triangles.shape[-1]
    drawn = [
        np.linalg.qr((np.sqrt(counts)[:, None, None] * triangles).reshape(-1, width), mode="r")
        for counts in drawn_counts(len(triangles), draws, seed)
    ]
    refit = partial(
        _refitted,
        structure=structure,
        friction=regressor.friction,
        start=start,
        known=known,
        iterations=iterations,
    )
    found = parallel_map(refit, drawn, "intervals of inertias")
    return np.concatenate([free for free, _ in found]), np.concatenate([rubbing for _, rubbing in found])


def _refitted(
    triangle: np.ndarray,
    structure: Structure,
    friction: Sequence[FrictionTerm],
    start: LinkInertias,
    known: LinkInertias,
    iterations: int,
) -> tuple[np.ndarray, np.ndarray]:
    return fit_structure(structure, triangle, friction, start, iterations, known)
