"""Learning while the robot moves: once through a motion, and a payload that is picked up on the way."""

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
import torch
from pydantic import Field, NonNegativeInt

from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.friction import FrictionTerm, friction_coefficients, friction_columns
from structlearn.rigid_body.identification import fit_structure, normalised_triangle
from structlearn.rigid_body.inertia_learner import MotionRegressor
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure, link_inertias
from structlearn.rigid_body.learner import (
    Kind,
    LearningParameters,
    Lesson,
    Loss,
    error_table,
    learn_online,
    learner,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import (
    SYMMETRIC_COLUMNS,
    link_parameters,
    torque_regressor,
    triangular_factor,
)
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

EMPTY_FRICTION: tuple[FrictionTerm, ...] = ("viscous", "coulomb")
"""Of a robot that picks something up."""


class PayloadLearningParameters(Parameters):
    """How a payload is followed. Fields: `params.yaml`, `online.payload`."""

    structure: Structure
    empty_s: float = Field(gt=0)
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)


class OnlineParameters(Parameters):
    """Parameters of online learning: each kind of model learns with each of the losses."""

    models: tuple[Kind, ...]
    seeds: tuple[NonNegativeInt, ...]
    losses: tuple[Loss, ...]
    stride: int = Field(ge=1)
    payload: PayloadLearningParameters


def learn_once_through(
    tree: KinematicTree, motion: Motion, parameters: OnlineParameters, learning: LearningParameters
) -> pd.DataFrame:
    """Errors on the whole motion while models go through it once, without shuffling (figure III.2).

    Returns:
        `model`, `loss`, `seed`, `batch` (0: before the first), `joint`, `nmse`.
    """
    kinds: dict[str, list[Kind]] = {}
    for kind in sorted(parameters.models, key=lambda kind: kind != "delan"):  # it takes longest
        kinds.setdefault("symmetric" if kind in STRUCTURES and kind != "nostr" else kind, []).append(kind)
    run = partial(_once_through, lesson=Lesson(tree, motion), parameters=parameters, learning=learning)
    return pd.concat(parallel_map(run, kinds.values(), "online learning"), ignore_index=True)


def learn_payload(
    log: tuple[Motion, float],
    tree: KinematicTree,
    inertias: LinkInertias,
    parameters: PayloadLearningParameters,
) -> pd.DataFrame:
    """Identify the empty arm at the start of a log, starting from `inertias`, then `follow_payload`.

    The log is a motion and the s between its samples.
    """
    motion, dt = log
    links, friction = identify_empty(tree, inertias, motion, dt, parameters)
    rigid = Motion(motion.q, motion.qd, motion.qdd, motion.torque - friction)
    return follow_payload(tree, links, rigid, dt, parameters)


def identify_empty(
    tree: KinematicTree, urdf: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> tuple[LinkInertias[np.ndarray], np.ndarray]:
    """Inertias of a robot's links, and friction torques (N, n) in N m that it had in a motion.

    Both are fitted to the first `empty_s` of the motion, which nothing is carried in yet.
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

    What is past is kept as one triangular factor (recursive least squares with forgetting), to which the
    structure is fitted after every batch. Every batch is predicted before it is learned from. Joints weigh as
    their torques varied in the first `empty_s`: nothing is learned from what is yet to come.

    Args:
        tree: the robot.
        known: inertias of the empty arm; the links but the last keep theirs.
        motion: in the order of time, torques without friction.
        dt: s between samples.
        parameters: see there.

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


def _once_through(
    kinds: Sequence[Kind], lesson: Lesson, parameters: OnlineParameters, learning: LearningParameters
) -> pd.DataFrame:
    tables, seeds = [], np.array(parameters.seeds)
    with one_thread():
        for kind, loss in product(kinds, parameters.losses):
            models = learner(kind, lesson, loss, parameters.seeds, learning)
            table = error_table(learn_online(models, parameters.stride), "batch")
            tables.append(table.assign(model=kind, loss=loss, seed=seeds[table["seed"]]))
    return pd.concat(tables, ignore_index=True)
