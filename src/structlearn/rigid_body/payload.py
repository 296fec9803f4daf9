"""Inertial parameters of an arm's payload: tracked online, and identified from pairs of motions.

Online, the last link is learned while the arm moves and picks something up. A load that is carried from the
start is identified from the same motions without and with it:

    tau = Y theta + F phi            without
    tau = Y theta + F phi + Y_n l    with: l are the ten parameters that the last link has gained

This is a single least-squares problem in which the arm itself need not be known. Both motions of a pair are
the same, so l is determined by the difference of their torques. Each joint's errors are divided by its
residual in a first fit.
"""

import math
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

EMPTY_FRICTION: tuple[FrictionTerm, ...] = ("viscous", "coulomb")  # of an arm that picks up a payload

UNKNOWN = 1e-6
"""Directions with less than this share of the largest singular value are set to zero in a bootstrap draw."""


class PayloadLearningParameters(Parameters):
    """Online tracking of a payload. Fields: `params.yaml`, `online.payload`."""

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
    """Identify the empty arm from the start of a log, starting from `inertias`, then `follow_payload`.

    The log is a motion and its sampling interval in s. Links and friction are fitted to the first `empty_s`,
    before anything is carried.
    """
    motion, dt = log
    links, friction = identify_empty(tree, inertias, motion, dt, parameters)
    rigid = Motion(motion.q, motion.qd, motion.qdd, motion.torque - friction)
    return follow_payload(tree, links, rigid, dt, parameters)


def identify_empty(
    tree: KinematicTree, urdf: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> tuple[LinkInertias[np.ndarray], np.ndarray]:
    """Inertias of the empty arm's links, and the friction torques (N, n) in N m of its motion.

    Both are fitted to the first `empty_s` of the motion, before anything is carried.
    """
    empty = motion.part(slice(0, round(parameters.empty_s / dt)))
    triangle = normalised_triangle(MotionRegressor(tree, empty, True, EMPTY_FRICTION).factors)
    structure = parameters.structure
    free, friction = fit_structure(structure, triangle, EMPTY_FRICTION, urdf, parameters.iterations)
    links = link_inertias(structure, torch.from_numpy(free[0])).arrays()
    coefficients = friction_coefficients(torch.from_numpy(friction), EMPTY_FRICTION)[0].numpy()
    return links, np.einsum("tjk,jk->tj", friction_columns(motion.q, motion.qd, EMPTY_FRICTION), coefficients)


def follow_payload(
    tree: KinematicTree, known: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> pd.DataFrame:
    """Learn the last link's inertia online, starting from the empty arm, while it picks something up.

    Past samples are kept as one triangular factor (recursive least squares with forgetting), to which the
    structure is fitted after every batch. Each batch is predicted before it is learned from. Joints are
    weighted by their torque variance in the first `empty_s`, so nothing is learned from the future. `motion`
    is in the order of time, `dt` s apart, without friction; all other links keep the inertias `known`.

    Returns:
        Per batch: `time_s` at its end; `nmse_fixed` and `nmse_learned` (squared errors over the variance of
        the whole motion, averaged over joints) of the empty arm and of the inertias learned before the batch;
        and the last link's gain after the batch: `mass_kg`, `moment_{x,y,z}_kg_m` (mass times position).
    """
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd)
    theta = link_parameters(known.tensors()).numpy()
    empty = LinkInertias(known.mass[-1:], known.first_moment[-1:], known.inertia[-1:])
    own = theta[-SYMMETRIC_COLUMNS:]
    seen = motion.part(slice(0, round(parameters.empty_s / dt)))
    scale = 1.0 / np.sqrt(seen.torque_variance)
    share = seen.torque_variance / motion.torque_variance  # rescales errors to the whole motion's variance
    last = columns[..., -SYMMETRIC_COLUMNS:] * scale[:, None]  # (N, n, 10)
    left = (motion.torque - columns[..., :-SYMMETRIC_COLUMNS] @ theta[:-SYMMETRIC_COLUMNS]) * scale

    forgetting = 0.5 ** (0.5 * parameters.batch * dt / parameters.memory_s)  # factor on square-root weights
    triangle = np.zeros((SYMMETRIC_COLUMNS + 1, SYMMETRIC_COLUMNS + 1))
    now, learned, rows = empty, own, []
    for start in range(0, len(motion), parameters.batch):
        batch = slice(start, start + parameters.batch)
        errors = [
            float((share * (last[batch] @ values - left[batch]) ** 2).mean()) for values in (own, learned)
        ]
        fresh = np.concatenate([last[batch], left[batch, :, None]], axis=-1).reshape(-1, triangle.shape[1])
        triangle = triangular_factor(np.vstack([forgetting * triangle, fresh / math.sqrt(len(fresh))]))
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
    """Inertial parameters of a load at the last link, from the same motions without and with the load.

    Every pair (e.g. a day) has its own friction. The bootstrap resamples blocks of `length` samples of a pair
    jointly in both motions, so repeatable errors, such as those of friction, partly cancel.

    Returns:
        (10,) mass in kg, first moment in kg m and inertia about the joint origin in kg m^2 (xx, xy, xz, yy,
        yz, zz), in the last joint's frame; and (draws, 10).
    """
    rows = [_rows(tree, pair, friction, place, len(pairs)) for place, pair in enumerate(pairs)]
    joints = len(tree.names)
    measured = np.concatenate([block[..., -1].reshape(-1, joints) for block in rows])
    theta, _ = _solved(rows, 1.0 / np.sqrt(measured.var(axis=0)))
    left = np.concatenate([(block[..., :-1] @ theta - block[..., -1]).reshape(-1, joints) for block in rows])
    weights = 1.0 / np.sqrt((left**2).mean(axis=0))
    theta, directions = _solved(rows, weights)
    known = np.zeros(())
    for place, block in enumerate(rows):
        scaled = block * weights[:, None]
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
    """(N, 2, n, P + 1) columns of a pair: links, every pair's friction, load, torque."""
    links = SYMMETRIC_COLUMNS * len(tree.names)
    parts = []
    for carries, motion in enumerate(pair):
        regressor = MotionRegressor(tree, motion.part(slice(None, min(map(len, pair)))), True, friction)
        own = regressor.columns[..., links:]
        others = [own if other == place else np.zeros_like(own) for other in range(pairs)]
        gained = carries * regressor.columns[..., links - SYMMETRIC_COLUMNS : links]
        columns = [regressor.columns[..., :links], *others, gained, regressor.torque[..., None]]
        parts.append(np.concatenate(columns, axis=-1))
    return np.stack(parts, axis=1)


def _solved(rows: Sequence[np.ndarray], weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minimum-norm least-squares solution (P,), and directions (P, r) along which the squares are one."""
    stacked = np.concatenate([(block * weights[:, None]).reshape(-1, block.shape[-1]) for block in rows])
    triangle = triangular_factor(stacked)
    left, strength, right = np.linalg.svd(triangle[:, :-1], full_matrices=False)
    known = strength > SINGULAR * strength[0]
    directions = right[known].T / strength[known]
    return directions @ (left[:, known].T @ triangle[:, -1]), directions
