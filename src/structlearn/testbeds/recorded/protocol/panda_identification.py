"""Dynamics models on a recorded motion of a Franka Emika Panda: learned on its start, tested on its end."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from structlearn.ground.metrics import nmse
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import one_thread
from structlearn.recordings.joint_log import JointLog
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.identification import fit_structure, least_squares, normalised_triangle
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.inertia_tables import link_table
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_learning import Kind, LearningParameters, Lesson, learner, shuffled_epochs
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.prediction import predicted_torques, rigid_body_torques
from structlearn.rigid_body.seeded_training import FRICTIONS
from structlearn.rigid_body.structured_learning import MotionRegressor
from structlearn.rigid_body.tree import KinematicTree, Robot
from structlearn.testbeds.recorded.protocol.panda_parameters import RecordedDynamicsParameters

URDF, LEAST_SQUARES = "urdf", "least_squares"
"""Models that nothing structured or neural was learned for."""

NETWORKS: dict[Kind, tuple[str, ...]] = {
    "mlp": ("none",),
    "mlp_scaled": ("none",),
    "delan": ("viscous", "coulomb"),
}
"""Networks and the friction beside them; perceptrons see the velocities and need none."""

LEARNED_FRICTIONS = ("viscous", "coulomb", "offset")

TRACE_STRIDE = 20
"""Every so manieth sample of the test part is kept for figures: 50 Hz."""


@dataclass(frozen=True)
class RecordedDynamicsResults:
    """Tables of the recorded motion.

    A `model` is a kind, `URDF` or `LEAST_SQUARES`; `friction` is a key of `FRICTIONS`.

    Attributes:
        errors: `model`, `friction`, `seed`, `part` (train or test), `joint` (from 1), `nmse`.
        friction: `model`, `friction`, `joint`, `term`, `value` in SI units.
        links: `link_table` with `model` and `friction`; the URDF's values stand as `true_*`.
        traces: test part: `time_s`, `joint`, `measured` and one column of torques in N m per model.
    """

    errors: pd.DataFrame
    friction: pd.DataFrame
    links: pd.DataFrame
    traces: pd.DataFrame


def panda_motion(log: JointLog, parameters: RecordedDynamicsParameters) -> Motion:
    """The log on one clock, without what is above the cut-off."""
    return measured_motion(
        log.name,
        log.time,
        log.positions,
        log.velocities,
        log.torques,
        parameters.rate_hz,
        parameters.cutoff_hz,
    )


def identify(
    robot: Robot, motion: Motion, parameters: RecordedDynamicsParameters, learning: LearningParameters
) -> tuple[dict[str, DynamicsModels], RecordedDynamicsResults]:
    """Every model on the first part of a motion, and its errors on both parts.

    Args:
        robot: with the inertias of its URDF, where identification starts.
        motion: of the robot.
        parameters: see there.
        learning: of the networks, with their optimiser.

    Returns:
        Models by `KIND` or `KIND_FRICTION`, and the tables.
    """
    parts = dict(zip(("train", "test"), motion.split(parameters.train_share), strict=True))
    work: list[tuple[Kind, str]] = [(kind, name) for kind, names in NETWORKS.items() for name in names]
    work = sorted(work, key=lambda item: item[0] != "delan")  # the longest first
    work += [(kind, friction) for friction in LEARNED_FRICTIONS for kind in STRUCTURES]
    learn = partial(_learned, robot=robot, motion=parts["train"], parameters=parameters, learning=learning)
    models = dict(zip(work, parallel_map(learn, work, "recorded dynamics"), strict=True))

    predictions = {(URDF, "none"): {name: _urdf_torques(robot, part)[None] for name, part in parts.items()}}
    coefficients = {}
    for friction in LEARNED_FRICTIONS:
        theta = _least_squares(robot.tree, parts["train"], FRICTIONS[friction])
        torques = {
            name: _regressed(robot.tree, part, FRICTIONS[friction], theta) for name, part in parts.items()
        }
        predictions[LEAST_SQUARES, friction] = {name: values[None] for name, values in torques.items()}
        links = 10 * parts["train"].joints
        coefficients[LEAST_SQUARES, friction] = theta[links:].reshape(parts["train"].joints, -1)
    for key, learned in models.items():
        predictions[key] = {
            name: predicted_torques(learned, robot.tree, part) for name, part in parts.items()
        }
        if learned.friction:
            coefficients[key] = learned.friction_coefficients()[0]

    tables = [
        link_table(robot.tree, learned.inertias(), robot.inertias).assign(model=kind, friction=friction)
        for (kind, friction), learned in models.items()
        if learned.structured
    ]
    results = RecordedDynamicsResults(
        errors=_errors(predictions, parts),
        friction=_friction(coefficients),
        links=pd.concat(tables, ignore_index=True),
        traces=_traces(predictions, parts["test"], parameters),
    )
    files = {
        kind if name in ("none", "viscous") else f"{kind}_{name}": its for (kind, name), its in models.items()
    }
    return files, results


def _learned(
    item: tuple[Kind, str],
    robot: Robot,
    motion: Motion,
    parameters: RecordedDynamicsParameters,
    learning: LearningParameters,
) -> DynamicsModels:
    kind, friction = item
    terms = FRICTIONS[friction]
    with one_thread():
        if kind in STRUCTURES:
            regressor = MotionRegressor(robot.tree, motion, kind != "nostr", terms)
            triangle = normalised_triangle(regressor.factors)
            free, rubbing = fit_structure(kind, triangle, terms, robot.inertias, parameters.iterations)
            state = {"inertia": free, "friction": rubbing}
            return DynamicsModels(kind, robot.tree.names, terms, (), state)
        seeds = range(parameters.seeds)
        models = learner(kind, Lesson(robot.tree, motion, terms), "normalised", seeds, learning)
        for _ in shuffled_epochs(models, parameters.epochs):
            pass
    return DynamicsModels(kind, robot.tree.names, terms, learning.hidden, models.state())


def _urdf_torques(robot: Robot, motion: Motion) -> np.ndarray:
    return rigid_body_torques(robot.tree, robot.inertias, motion)


def _least_squares(tree: KinematicTree, motion: Motion, terms: Sequence[FrictionTerm]) -> np.ndarray:
    return least_squares(normalised_triangle(MotionRegressor(tree, motion, True, terms).factors))


def _regressed(
    tree: KinematicTree, motion: Motion, terms: Sequence[FrictionTerm], theta: np.ndarray
) -> np.ndarray:
    """Torques (N, n) of parameters that need not be those of a body."""
    return MotionRegressor(tree, motion, True, terms).columns @ theta


def _errors(predictions: dict, parts: dict[str, Motion]) -> pd.DataFrame:
    rows = []
    for (model, friction), torques in predictions.items():
        for name, part in parts.items():
            for seed, values in enumerate(torques[name]):
                error = nmse(values, part.torque)
                columns = {"joint": np.arange(1, part.joints + 1), "nmse": error}
                keys = {"model": model, "friction": friction, "seed": seed, "part": name}
                rows.append(pd.DataFrame(keys | columns))
    return pd.concat(rows, ignore_index=True)


def _friction(coefficients: dict[tuple[str, str], np.ndarray]) -> pd.DataFrame:
    rows = [
        {
            "model": model,
            "friction": friction,
            "joint": joint + 1,
            "term": term,
            "value": values[joint, place],
        }
        for (model, friction), values in coefficients.items()
        for joint in range(len(values))
        for place, term in enumerate(FRICTIONS[friction])
    ]
    return pd.DataFrame(rows)


def _traces(predictions: dict, test: Motion, parameters: RecordedDynamicsParameters) -> pd.DataFrame:
    """The first seed's torques, thinned."""
    kept = slice(None, None, TRACE_STRIDE)
    time = np.arange(len(test))[kept] / parameters.rate_hz
    columns = {
        "time_s": np.tile(time, test.joints),
        "joint": np.repeat(np.arange(1, test.joints + 1), len(time)),
        "measured": test.torque[kept].T.ravel(),
    }
    for (model, friction), torques in predictions.items():
        name = model if friction == "none" else f"{model}_{friction}"
        columns[name] = torques["test"][0][kept].T.ravel()
    return pd.DataFrame(columns)
