"""Comparison of all models of an arm: trained on one part of its motion, torques predicted for the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.networks.torch_settings import one_thread
from structlearn.rigid_body.base_parameters import link_table
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.dynamics_training import (
    Kind,
    LearningParameters,
    Lesson,
    learner,
    shuffled_epochs,
)
from structlearn.rigid_body.friction import FRICTIONS
from structlearn.rigid_body.identification import fit_structure, least_squares, normalised_triangle
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.newton_euler import torque_differences
from structlearn.rigid_body.regressor import MotionRegressor
from structlearn.rigid_body.tree import Robot, read_urdf
from structlearn.rigid_body.urdf import write_urdf

URDF, LEAST_SQUARES = "urdf", "least_squares"  # models without training

NETWORKS: dict[Kind, tuple[str, ...]] = {
    "mlp": ("none",),
    "mlp_scaled": ("none",),
    "delan": ("viscous", "coulomb"),
}
"""Networks and the friction beside them; perceptrons see the velocities and need none."""

LEARNED_FRICTIONS = ("viscous", "coulomb", "offset")

TRAIN = "train"  # part that is learned from
CONSISTENT = ("tri", "cov")  # structures of physically consistent inertias

ModelKey = tuple[str, str]
"""A kind, `URDF` or `LEAST_SQUARES`, and a key of `FRICTIONS`."""


@dataclass(frozen=True)
class NetworkTraining:
    """Training of the networks of a kind: all epochs, one network per seed."""

    learning: LearningParameters
    seeds: int
    epochs: int


@dataclass(frozen=True)
class Fitting:
    """How structures are fitted."""

    iterations: int  # of L-BFGS
    limits: np.ndarray | None = None  # see `identification.normalised_triangle`; of least squares too
    prior: float = 0.0  # weight of the divergence from the URDF, of consistent structures (`fit_structure`)


@dataclass(frozen=True)
class Identified:
    """Models of an arm by kind and friction."""

    models: Mapping[ModelKey, DynamicsModels]
    torques: Mapping[ModelKey, Mapping[str, np.ndarray]]  # (M, N, n) N m of each model on each part


def identify_arm(
    robot: Robot,
    parts: Mapping[str, Motion],
    fitting: Fitting,
    networks: Mapping[Kind, NetworkTraining],
    structures: Sequence[Structure] = STRUCTURES,
    frictions: Sequence[str] = LEARNED_FRICTIONS,
) -> Identified:
    """Train every model on the part `TRAIN`, and predict the torques of all parts.

    Identification starts from the URDF's inertias; structures are learned with each of the frictions,
    networks with those of `NETWORKS`.
    """
    kinds = [kind for kind in NETWORKS if kind in networks]
    work: list[tuple[Kind, str]] = [(kind, name) for kind in kinds for name in NETWORKS[kind]]
    work.sort(key=lambda item: item[0] != "delan")  # the longest first
    work += [(kind, friction) for friction in frictions for kind in structures]
    learn = partial(_learned, robot=robot, motion=parts[TRAIN], fitting=fitting, networks=networks)
    models: dict[ModelKey, DynamicsModels] = dict(
        zip(work, parallel_map(learn, work, "recorded dynamics"), strict=True)
    )
    tree = robot.tree
    urdf = {name: rigid_body_torques(tree, robot.inertias, part)[None] for name, part in parts.items()}
    torques: dict[ModelKey, dict[str, np.ndarray]] = {(URDF, "none"): urdf}
    for friction in frictions:
        its = {name: MotionRegressor(tree, part, True, FRICTIONS[friction]) for name, part in parts.items()}
        theta = least_squares(normalised_triangle(its[TRAIN].factors, fitting.limits))
        torques[LEAST_SQUARES, friction] = {name: (one.columns @ theta)[None] for name, one in its.items()}
    for key, learned in models.items():
        torques[key] = {name: predicted_torques(learned, tree, part) for name, part in parts.items()}
    return Identified(models, torques)


def error_table(identified: Identified, parts: Mapping[str, Motion]) -> pd.DataFrame:
    """`model`, `friction`, `seed`, `part`, `joint` (from 1), `nmse`."""
    rows = [
        (model, friction, seed, name, joint, error)
        for (model, friction), torques in identified.torques.items()
        for name, part in parts.items()
        for seed, values in enumerate(torques[name])
        for joint, error in enumerate(nmse(values, part.torque), start=1)
    ]
    return pd.DataFrame(rows, columns=["model", "friction", "seed", "part", "joint", "nmse"])


def body_table(identified: Identified, robot: Robot) -> pd.DataFrame:
    """`link_table` with `model` and `friction`; the URDF's values are `true_*`."""
    tables = [
        link_table(robot.tree, learned.inertias(), robot.inertias).assign(model=kind, friction=friction)
        for (kind, friction), learned in identified.models.items()
        if learned.structured
    ]
    return pd.concat(tables, ignore_index=True)


def trace_table(
    identified: Identified, part: str, motion: Motion, rate_hz: float, stride: int
) -> pd.DataFrame:
    """Torques of the first seeds on a part, every `stride`-th sample, in N m.

    Columns `time_s`, `joint`, `measured` and one per model, `KIND` or `KIND_FRICTION`.
    """
    kept = slice(None, None, stride)
    time = np.arange(len(motion))[kept] / rate_hz
    columns = {
        "time_s": np.tile(time, motion.joints),
        "joint": np.repeat(np.arange(1, motion.joints + 1), len(time)),
        "measured": motion.torque[kept].T.ravel(),
    }
    for (model, friction), torques in identified.torques.items():
        name = model if friction == "none" else f"{model}_{friction}"
        columns[name] = torques[part][0][kept].T.ravel()
    return pd.DataFrame(columns)


def write_identified(
    source: Path, target: Path, robot: Robot, identified: Identified, friction: str
) -> pd.DataFrame:
    """Write the model Cov as a URDF, which cannot hold an offset of friction, and check the file.

    Returns `joint`, `difference_n_m`: largest difference at random states between torques of the model and
    those of Pinocchio's recursive Newton-Euler with the file.
    """
    model = identified.models["cov", friction]
    inertias = model.inertias().of(0)
    viscous, coulomb = model.friction_coefficients()[0].T[:2]
    write_urdf(source, target, robot.tree, inertias, viscous, coulomb)
    differences = torque_differences(read_urdf(target), inertias)
    return pd.DataFrame({"joint": np.arange(1, len(differences) + 1), "difference_n_m": differences})


def _learned(
    item: tuple[Kind, str],
    robot: Robot,
    motion: Motion,
    fitting: Fitting,
    networks: Mapping[Kind, NetworkTraining],
) -> DynamicsModels:
    kind, terms, tree = item[0], FRICTIONS[item[1]], robot.tree
    with one_thread():
        if kind not in STRUCTURES:
            training, lesson = networks[kind], Lesson(tree, motion, terms)
            models = learner(kind, lesson, "normalised", range(training.seeds), training.learning)
            for _ in shuffled_epochs(models, training.epochs):
                pass
            return DynamicsModels(kind, tree.names, terms, training.learning.hidden, models.state())
        regressor = MotionRegressor(tree, motion, kind != "nostr", terms)
        triangle = normalised_triangle(regressor.factors, fitting.limits)
        prior = fitting.prior if kind in CONSISTENT else 0.0
        free, rubbing = fit_structure(kind, triangle, terms, robot.inertias, fitting.iterations, prior=prior)
        return DynamicsModels(kind, tree.names, terms, (), {"inertia": free, "friction": rubbing})
