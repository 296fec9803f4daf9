"""How far identified inertias can be trusted: the same fit on blocks of the motion drawn anew."""

from dataclasses import replace
from functools import partial

import numpy as np

from structlearn.ground.block_bootstrap import blocks, drawn_counts
from structlearn.ground.parallel import parallel_map
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.identification import fit_structure, normalised_triangle
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.regressor import torque_factors, triangular_factor
from structlearn.rigid_body.tree import LinkInertias


def drawn_fits(
    model: DynamicsModels,
    regressor: MotionRegressor,
    known: LinkInertias,
    iterations: int,
    length: int,
    draws: int,
    seed: int,
) -> DynamicsModels:
    """Fits of a structure to blocks of a motion, drawn with replacement.

    Args:
        model: the fit to the whole motion, one, of a structure other than nostr.
        regressor: of the motion, with the model's terms of friction.
        known: where the weak pull goes that decides what the data leave open.
        iterations: of L-BFGS per draw.
        length: samples of a block.
        draws: of the bootstrap.
        seed: of the draws.

    Returns:
        So many models of the same kind.
    """
    its = model.inertias()
    start = LinkInertias(its.mass[0], its.first_moment[0], its.inertia[0])
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
        triangular_factor((np.sqrt(counts)[:, None, None] * triangles).reshape(-1, width))
        for counts in drawn_counts(len(triangles), draws, seed)
    ]
    refit = partial(_refitted, model=model, start=start, known=known, iterations=iterations)
    found = parallel_map(refit, drawn, "intervals of inertias")
    names = ("inertia", "friction")
    state = {
        name: np.concatenate(values) for name, values in zip(names, zip(*found, strict=True), strict=True)
    }
    return replace(model, state=state)


def _refitted(
    triangle: np.ndarray, model: DynamicsModels, start: LinkInertias, known: LinkInertias, iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    rubbing = np.asarray(model.state["friction"])
    return fit_structure(model.structure, triangle, model.friction, start, iterations, known, rubbing)
