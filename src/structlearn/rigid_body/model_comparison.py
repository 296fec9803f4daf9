"""Comparison of an arm's dynamics models: trained on one part of its motion, tested on the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.metrics import block_count, block_sums, nmse
from structlearn.core.parallel import parallel_map
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.base_parameters import link_table
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.dynamics_training import (
    Kind,
    LearningParameters,
    TrainingData,
    learner,
    shuffled_epochs,
)
from structlearn.rigid_body.friction import FRICTIONS
from structlearn.rigid_body.identification import fit_structure, normalised_triangle, unconstrained_minimiser
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import MotionRegressor, link_parameters, torque_regressor
from structlearn.rigid_body.robot import Robot, read_urdf, torque_differences
from structlearn.rigid_body.urdf import write_urdf

URDF, LEAST_SQUARES = "urdf", "least_squares"  # untrained model, and unstructured least squares

NETWORKS: dict[Kind, tuple[str, ...]] = {
    "mlp": ("none",),
    "mlp_scaled": ("none",),
    "delan": ("viscous", "coulomb"),
}
"""Networks, and the friction learned beside them; perceptrons see the velocities and need none."""

LEARNED_FRICTIONS = ("viscous", "coulomb", "offset")

TRAIN = "train"  # name of the part to train on
CONSISTENT = ("tri", "cov")  # structures with physically consistent inertias

ModelKey = tuple[str, str]
"""(kind or `URDF` or `LEAST_SQUARES`, key of `FRICTIONS`)."""


@dataclass(frozen=True)
class NetworkTraining:
    """Training of the networks of a kind: all epochs, one network per seed."""

    learning: LearningParameters
    seeds: int
    epochs: int


Models = Mapping[ModelKey, DynamicsModels]
Torques = Mapping[ModelKey, Mapping[str, np.ndarray]]
"""(M, N, n) N m, by model and part."""


def identify_arm(
    robot: Robot,
    parts: Mapping[str, Motion],
    structures: Sequence[Structure],
    frictions: Sequence[str],
    networks: Mapping[Kind, NetworkTraining],
    *,
    iterations: int,
    limits: np.ndarray | None,
    prior: float,
) -> tuple[Models, Torques]:
    """Train every model on the part `TRAIN`, and predict the torques of all parts.

    Identification starts from the URDF's inertias. Structures are learned with each of `frictions`, networks
    with those of `NETWORKS`.

    Args:
        robot: as in its URDF.
        parts: motions by name.
        structures: structures to identify.
        frictions: keys of `FRICTIONS`, for structures and least squares.
        networks: networks to train.
        iterations: most iterations of L-BFGS.
        limits: as in `identification.normalised_triangle`; also for least squares.
        prior: weight of the divergence from the URDF, for consistent structures (`fit_structure`).
    """
    kinds = [kind for kind in NETWORKS if kind in networks]
    work: list[tuple[Kind, str]] = [(kind, name) for kind in kinds for name in NETWORKS[kind]]
    work.sort(key=lambda item: item[0] != "delan")  # the slowest first
    work += [(kind, friction) for friction in frictions for kind in structures]
    learned_from = partial(_learned, robot=robot, motion=parts[TRAIN], networks=networks)
    learn = partial(learned_from, iterations=iterations, limits=limits, prior=prior)
    models: Models = dict(zip(work, parallel_map(learn, work, "recorded dynamics"), strict=True))
    tree = robot.tree
    urdf = {name: rigid_body_torques(tree, robot.inertias, part)[None] for name, part in parts.items()}
    torques: dict[ModelKey, dict[str, np.ndarray]] = {(URDF, "none"): urdf}
    for friction in frictions:
        regressors = {
            name: MotionRegressor(tree, part, True, FRICTIONS[friction]) for name, part in parts.items()
        }
        theta = unconstrained_minimiser(normalised_triangle(regressors[TRAIN].factors, limits))
        torques[LEAST_SQUARES, friction] = {
            name: (regressor.columns @ theta)[None] for name, regressor in regressors.items()
        }
    for key, learned in models.items():
        torques[key] = {name: predicted_torques(learned, tree, part) for name, part in parts.items()}
    return models, torques


def error_table(torques: Torques, parts: Mapping[str, Motion]) -> pd.DataFrame:
    """Table of errors: `model`, `friction`, `seed`, `part`, `joint` (from 1), `nmse`."""
    rows = [
        (model, friction, seed, name, joint, error)
        for (model, friction), predicted in torques.items()
        for name, part in parts.items()
        for seed, values in enumerate(predicted[name])
        for joint, error in enumerate(nmse(values, part.torque), start=1)
    ]
    return pd.DataFrame(rows, columns=["model", "friction", "seed", "part", "joint", "nmse"])


def block_table(torques: Torques, parts: Mapping[str, Motion], length: int) -> pd.DataFrame:
    """Sums over blocks of `length` samples, from which errors per part and their intervals are computed.

    Columns: `part`, `block`, `joint`, `samples`, sums `torque` and `torque_squared`, and per model
    (`KIND/FRICTION`) the summed squared error, averaged over seeds. Read by `motion.drawn_nmse`.
    """
    tables = []
    for name, part in parts.items():
        count = block_count(len(part), length)
        sums = {"samples": np.ones_like(part.torque), "torque": part.torque, "torque_squared": part.torque**2}
        sums |= {
            "/".join(key): ((predicted[name] - part.torque) ** 2).mean(axis=0)
            for key, predicted in torques.items()
        }
        columns = {key: block_sums(values, length).ravel() for key, values in sums.items()}
        block, joint = (places.ravel() for places in np.indices((count, part.joints)))
        tables.append(pd.DataFrame({"part": name, "block": block, "joint": joint + 1} | columns))
    return pd.concat(tables, ignore_index=True)


def block_norms(torques: Torques, parts: Mapping[str, Motion], length: int) -> pd.DataFrame:
    """As `block_table`, over all joints: `part`, `block`, `samples`, and summed error norms in N m."""
    tables = []
    for name, part in parts.items():
        samples = block_sums(np.ones(len(part)), length)
        columns = {"part": name, "block": np.arange(len(samples)), "samples": samples}
        for key, predicted in torques.items():
            norms = np.linalg.norm(predicted[name] - part.torque, axis=-1).mean(axis=0)
            columns["/".join(key)] = block_sums(norms, length)
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def body_table(models: Models, robot: Robot) -> pd.DataFrame:
    """`link_table` with `model` and `friction`; the URDF's values are in `true_*`."""
    tables = [
        link_table(robot.tree, learned.inertias(), robot.inertias).assign(model=kind, friction=friction)
        for (kind, friction), learned in models.items()
        if learned.structured
    ]
    return pd.concat(tables, ignore_index=True)


def torque_traces(torques: Torques, part: str, motion: Motion, rate_hz: float, stride: int) -> pd.DataFrame:
    """Measured and predicted torques in N m of a part, every `stride`-th sample, first seed of each model.

    Columns `time_s`, `joint`, `measured` and one per model, `KIND` or `KIND_FRICTION`.
    """
    kept = slice(None, None, stride)
    time = np.arange(len(motion))[kept] / rate_hz
    columns = {
        "time_s": np.tile(time, motion.joints),
        "joint": np.repeat(np.arange(1, motion.joints + 1), len(time)),
        "measured": motion.torque[kept].T.ravel(),
    }
    for (model, friction), predicted in torques.items():
        name = model if friction == "none" else f"{model}_{friction}"
        columns[name] = predicted[part][0][kept].T.ravel()
    return pd.DataFrame(columns)


def write_identified(source: Path, target: Path, robot: Robot, model: DynamicsModels) -> pd.DataFrame:
    """Write the first model of a structure as a URDF, without the friction offset, and check the file.

    Returns `joint`, `difference_n_m`: largest torque difference at random states between the model and
    Pinocchio's recursive Newton-Euler on the file.
    """
    inertias = model.inertias().of(0)
    viscous, coulomb = model.friction_coefficients()[0].T[:2]
    write_urdf(source, target, robot.tree, inertias, viscous, coulomb)
    theta = link_parameters(inertias.tensors()).numpy()
    differences = torque_differences(
        read_urdf(target), lambda *states: torque_regressor(robot.tree, *states) @ theta
    )
    return pd.DataFrame({"joint": np.arange(1, len(differences) + 1), "difference_n_m": differences})


def _learned(
    item: tuple[Kind, str],
    robot: Robot,
    motion: Motion,
    networks: Mapping[Kind, NetworkTraining],
    iterations: int,
    limits: np.ndarray | None,
    prior: float,
) -> DynamicsModels:
    kind, terms, tree = item[0], FRICTIONS[item[1]], robot.tree
    with one_thread():
        if kind not in STRUCTURES:
            training, data = networks[kind], TrainingData(tree, motion, terms)
            models = learner(kind, data, "normalised", range(training.seeds), training.learning)
            for _ in shuffled_epochs(models, training.epochs):
                pass
            return DynamicsModels(kind, tree.names, terms, training.learning.hidden, models.state())
        triangle = normalised_triangle(MotionRegressor(tree, motion, kind != "nostr", terms).factors, limits)
        prior = prior if kind in CONSISTENT else 0.0
        free, friction = fit_structure(kind, triangle, terms, robot.inertias, iterations, prior=prior)
        return DynamicsModels(kind, tree.names, terms, (), {"inertia": free, "friction": friction})
