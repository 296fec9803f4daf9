"""Inertial parameters of what an arm carries: followed online, and identified from pairs of motions.

Online, the last link is learned while the arm moves; it picks something up on the way. A load that is carried
from the start shows in motions without it and the same motions with it:

    tau = Y theta + F phi            without
    tau = Y theta + F phi + Y_n l    with: l are the ten parameters of what the last link has gained

This is one least-squares problem, in which the arm itself need not be known. Both motions of a pair are the
same, so l rests on the difference of their torques. Errors of each joint are divided by its residual in a
first fit.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import torch
from pydantic import Field

from structlearn.core.metrics import blocks, drawn_counts
from structlearn.core.params import Parameters
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.identification import SINGULAR, fit_structure, normalised_triangle
from structlearn.rigid_body.inertia_parameters import Structure, link_inertias
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import (
    SYMMETRIC_COLUMNS,
    MotionRegressor,
    link_parameters,
    torque_regressor,
    triangular_factor,
)
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

EMPTY_FRICTION: tuple[FrictionTerm, ...] = ("viscous", "coulomb")  # of an arm that picks something up

UNKNOWN = 1e-6
"""Directions of which a draw of blocks says less than this share of the best known are left at zero."""


class PayloadLearningParameters(Parameters):
    """How a payload is followed. Fields: `params.yaml`, `online.payload`."""

    structure: Structure
    empty_s: float = Field(gt=0)
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)


def learn_payload(
    log: tuple[Motion, float],
    tree: KinematicTree,
    inertias: LinkInertias,
    parameters: PayloadLearningParameters,
) -> pd.DataFrame:
    """Identify the empty arm at the start of a log, starting from `inertias`, then `follow_payload`.

    The log is a motion and the s between its samples. Links and friction are fitted to its first `empty_s`,
    in which nothing is carried yet.
    """
    motion, dt = log
    links, friction = identify_empty(tree, inertias, motion, dt, parameters)
    rigid = Motion(motion.q, motion.qd, motion.qdd, motion.torque - friction)
    return follow_payload(tree, links, rigid, dt, parameters)


def identify_empty(
    tree: KinematicTree, urdf: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> tuple[LinkInertias[np.ndarray], np.ndarray]:
    """Inertias of an arm's links, and the friction torques (N, n) in N m that it had in a motion.

    Both are fitted to the first `empty_s` of the motion, in which nothing is carried yet.
    """
    empty = motion.part(slice(0, round(parameters.empty_s / dt)))
    triangle = normalised_triangle(MotionRegressor(tree, empty, True, EMPTY_FRICTION).factors)
    free, rubbing = fit_structure(parameters.structure, triangle, EMPTY_FRICTION, urdf, parameters.iterations)
    links = link_inertias(parameters.structure, torch.from_numpy(free[0])).arrays()
    coefficients = friction_coefficients(torch.from_numpy(rubbing), EMPTY_FRICTION)[0].numpy()
    return links, np.einsum("tjk,jk->tj", friction_columns(motion.q, motion.qd, EMPTY_FRICTION), coefficients)


def follow_payload(
    tree: KinematicTree, known: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> pd.DataFrame:
    """Learn the last link's inertia online, from that of the empty arm, while the arm picks something up.

    The past is one triangular factor (recursive least squares with forgetting), to which the structure is
    fitted after every batch. Each batch is predicted before it is learned from. Joints weigh as their torques
    varied in the first `empty_s`: nothing is learned from what is yet to come. `motion` is in the order of
    time, `dt` s apart, without friction; all links but the last keep the inertias `known`.

    Returns:
        Per batch: `time_s` at its end; `nmse_fixed` and `nmse_learned` (mean over the joints of squared
        errors over the whole motion's variance) of the empty arm's inertias and of those learned before the
        batch; and what the last link has gained after it: `mass_kg`, `moment_{x,y,z}_kg_m` (mass times
        position).
    """
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd)
    theta = link_parameters(known.tensors()).numpy()
    empty = LinkInertias(known.mass[-1:], known.first_moment[-1:], known.inertia[-1:])
    own = theta[-SYMMETRIC_COLUMNS:]
    seen = motion.part(slice(0, round(parameters.empty_s / dt)))
    scale = 1.0 / np.sqrt(seen.torque_variance)
    share = seen.torque_variance / motion.torque_variance  # of squared errors, in those of the whole motion
    last = columns[..., -SYMMETRIC_COLUMNS:] * scale[:, None]  # (N, n, 10)
    left = (motion.torque - columns[..., :-SYMMETRIC_COLUMNS] @ theta[:-SYMMETRIC_COLUMNS]) * scale

    forgetting = 0.5 ** (0.5 * parameters.batch * dt / parameters.memory_s)  # of roots of weights
    triangle = np.zeros((SYMMETRIC_COLUMNS + 1, SYMMETRIC_COLUMNS + 1))
    now, learned, rows = empty, own, []
    for start in range(0, len(motion), parameters.batch):
        batch = slice(start, start + parameters.batch)
        errors = [
            float((share * (last[batch] @ values - left[batch]) ** 2).mean()) for values in (own, learned)
        ]
        fresh = np.concatenate([last[batch], left[batch, :, None]], axis=-1).reshape(-1, triangle.shape[1])
        triangle = triangular_factor(np.vstack([forgetting * triangle, fresh / len(fresh) ** 0.5]))
        free, _ = fit_structure(parameters.structure, triangle, (), now, parameters.iterations, empty)
        fitted = link_inertias(parameters.structure, torch.from_numpy(free[0]))
        now, learned = fitted.arrays(), link_parameters(fitted).numpy()
        gained = (now.first_moment - empty.first_moment)[0]
        end = min(start + parameters.batch, len(motion)) * dt
        rows.append((end, *errors, now.mass[0] - empty.mass[0], *gained))
    moments = [f"moment_{axis}_kg_m" for axis in "xyz"]
    return pd.DataFrame(rows, columns=["time_s", "nmse_fixed", "nmse_learned", "mass_kg", *moments])


def identify_load(
    tree: KinematicTree,
    pairs: Sequence[tuple[Motion, Motion]],
    friction: Sequence[FrictionTerm],
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Inertial parameters of a load at the last link, from the same motions without the load and with it.

    Every pair, e.g. a day, has friction of its own. The bootstrap draws blocks of `length` samples of a pair
    with both motions, so errors that come back whenever the arm passes there, as those of friction, cancel in
    part.

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
    tree: KinematicTree, pair: tuple[Motion, Motion], friction: Sequence[FrictionTerm], place: int, pairs: int
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
    """Smallest least-squares solution (P,), and directions (P, r) along which the squares are one."""
    stacked = np.concatenate([(its * weights[:, None]).reshape(-1, its.shape[-1]) for its in rows])
    triangle = triangular_factor(stacked)
    left, strength, right = np.linalg.svd(triangle[:, :-1], full_matrices=False)
    known = strength > SINGULAR * strength[0]
    directions = right[known].T / strength[known]
    return directions @ (left[:, known].T @ triangle[:, -1]), directions
