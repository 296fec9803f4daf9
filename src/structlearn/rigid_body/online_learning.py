"""Learning while the robot moves: once through a motion, and a payload that is picked up on the way."""

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
import pandas as pd
import torch
from pydantic import Field

from structlearn.ground.parallel import parallel_map
from structlearn.ground.params import Parameters
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.identification import fit_structure
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure, link_inertias
from structlearn.rigid_body.model_learning import (
    Kind,
    LearningParameters,
    Lesson,
    Loss,
    error_table,
    learn_online,
    learner,
)
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import SYMMETRIC_COLUMNS, link_parameters, torque_regressor
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


class PayloadLearningParameters(Parameters):
    """Parameters of following a payload.

    Attributes:
        structure: of the last link, all that is learned.
        batch: samples between two fits.
        memory_s: after this time a sample's weight has fallen to a half.
        iterations: of L-BFGS per fit.
    """

    structure: Structure
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)


class OnlineParameters(Parameters):
    """Parameters of online learning.

    Attributes:
        models: kinds that go through the motion.
        seeds: models of each kind.
        losses: each with all of them.
        learning: how they learn.
        payload: how a payload is followed.
    """

    models: tuple[Kind, ...]
    seeds: int = Field(ge=1)
    losses: tuple[Loss, ...]
    learning: LearningParameters
    payload: PayloadLearningParameters


def learn_once_through(tree: KinematicTree, motion: Motion, parameters: OnlineParameters) -> pd.DataFrame:
    """Errors on the whole motion while models go through it once, without shuffling (figure III.2).

    Args:
        tree: the robot.
        motion: to learn from, in the order of time.
        parameters: see there.

    Returns:
        `model`, `loss`, `seed`, `batch` (0: before the first), `joint`, `nmse`.
    """
    kinds: dict[str, list[Kind]] = {}
    for kind in sorted(parameters.models, key=lambda kind: kind != "delan"):  # it takes longest
        kinds.setdefault("symmetric" if kind in STRUCTURES and kind != "nostr" else kind, []).append(kind)
    run = partial(_once_through, lesson=Lesson(tree, motion), parameters=parameters)
    return pd.concat(parallel_map(run, kinds.values(), "online learning"), ignore_index=True)


def follow_payload(
    tree: KinematicTree, known: LinkInertias, motion: Motion, dt: float, parameters: PayloadLearningParameters
) -> pd.DataFrame:
    """Learn the last link's inertia online, from that of the empty arm, while the arm picks something up.

    What is past is kept as one triangular factor (recursive least squares with forgetting), to which the
    structure is fitted after every batch. Every batch is predicted before it is learned from.

    Args:
        tree: the robot.
        known: inertias of the empty arm; the links but the last keep theirs.
        motion: in the order of time.
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
    scale = 1.0 / np.sqrt(motion.torque_variance)
    last = columns[..., -SYMMETRIC_COLUMNS:] * scale[:, None]  # (N, n, 10)
    left = (motion.torque - columns[..., :-SYMMETRIC_COLUMNS] @ theta[:-SYMMETRIC_COLUMNS]) * scale

    forgetting = 0.5 ** (0.5 * parameters.batch * dt / parameters.memory_s)  # of roots of weights
    triangle = np.zeros((SYMMETRIC_COLUMNS + 1, SYMMETRIC_COLUMNS + 1))
    now, learned, rows = empty, own, []
    for start in range(0, len(motion), parameters.batch):
        batch = slice(start, start + parameters.batch)
        errors = [float(((last[batch] @ values - left[batch]) ** 2).mean()) for values in (own, learned)]
        fresh = np.concatenate([last[batch], left[batch, :, None]], axis=-1).reshape(-1, triangle.shape[1])
        triangle = np.linalg.qr(np.vstack([forgetting * triangle, fresh / len(fresh) ** 0.5]), mode="r")
        free, _ = fit_structure(parameters.structure, triangle, (), now, parameters.iterations, empty)
        fitted = link_inertias(parameters.structure, torch.from_numpy(free[0]))
        now, learned = fitted.arrays(), link_parameters(fitted).numpy()
        gained = (now.first_moment - empty.first_moment)[0]
        end = min(start + parameters.batch, len(motion)) * dt
        rows.append((end, *errors, now.mass[0] - empty.mass[0], *gained))
    moments = [f"moment_{axis}_kg_m" for axis in "xyz"]
    return pd.DataFrame(rows, columns=["time_s", "nmse_fixed", "nmse_learned", "mass_kg", *moments])


def _once_through(kinds: Sequence[Kind], lesson: Lesson, parameters: OnlineParameters) -> pd.DataFrame:
    tables, learning = [], parameters.learning
    with one_thread():
        for kind, loss in product(kinds, parameters.losses):
            models = learner(kind, lesson, loss, range(parameters.seeds), learning)
            nmse = learn_online(models, learning.stride).nmse
            tables.append(error_table(nmse, "batch").assign(model=kind, loss=loss))
    return pd.concat(tables, ignore_index=True)
