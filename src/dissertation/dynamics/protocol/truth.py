"""Comparison with the truth: errors of known models, learned friction, residual torques, and Pinocchio."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from dissertation.simulation.arm import Mechanics
from structlearn.core.metrics import nmse
from structlearn.rigid_body.compiled_dynamics import inverse_dynamics
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.robot import Robot, torque_differences

TERMS: tuple[FrictionTerm, ...] = ("viscous", "coulomb")  # friction of the simulated robots
FRICTION_MODELS = ("cov", f"cov{COULOMB}")  # whose learned friction is compared with the true one
RESIDUAL_RATE_HZ = 10.0  # sampling rate of the residual torques kept for drawing


def known_errors(robot: Robot, mechanics: Mechanics, motion: Motion) -> pd.DataFrame:
    """Errors of the models not learned, truth and URDF (default): `model`, `joint` (from 1), `nmse`."""
    coefficients = np.stack([mechanics.viscous, mechanics.coulomb], axis=-1)
    friction = np.einsum("tjk,jk->tj", friction_columns(motion.q, motion.qd, TERMS), coefficients)
    torques = {
        GROUND_TRUTH: rigid_body_torques(robot.tree, mechanics.inertias, motion) + friction,
        DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion),
    }
    errors = pd.DataFrame({name: nmse(found, motion.torque) for name, found in torques.items()})
    errors["joint"] = np.arange(1, motion.joints + 1)
    return errors.melt("joint", var_name="model", value_name="nmse")[["model", "joint", "nmse"]]


def friction_table(models: Mapping[str, DynamicsModels], mechanics: Mechanics) -> pd.DataFrame:
    """Learned and true friction coefficients of one robot, for the first model of each set.

    Returns `model`, `joint` (from 1), `term`, `value` in N m s/rad or N m, and `truth`.
    """
    rows = []
    for name, its in models.items():
        learned = its.friction_coefficients()[0]  # (n, t)
        for place, term in enumerate(its.friction):
            pairs = zip(learned[:, place], getattr(mechanics, term), strict=True)
            rows += [(name, joint, term, *pair) for joint, pair in enumerate(pairs, start=1)]
    return pd.DataFrame(rows, columns=["model", "joint", "term", "value", "truth"])


def residual_torques(robot: Robot, models: DynamicsModels, motion: Motion, rate_hz: float) -> pd.DataFrame:
    """Measured torques minus the first model's rigid-body torques: friction and noise, at `RESIDUAL_RATE_HZ`.

    Returns `joint` (from 1), `velocity_rad_s`, `residual_n_m`, `friction_n_m`.
    """
    kept = motion.part(slice(None, None, max(1, round(rate_hz / RESIDUAL_RATE_HZ))))
    links = rigid_body_torques(robot.tree, models.inertias(), kept)[0]
    friction = predicted_torques(models, robot.tree, kept)[0] - links
    columns = {"velocity_rad_s": kept.qd, "residual_n_m": kept.torque - links, "friction_n_m": friction}
    joint = np.tile(np.arange(1, kept.joints + 1), len(kept))
    return pd.DataFrame({"joint": joint} | {name: values.ravel() for name, values in columns.items()})


def agreement_with_pinocchio(robot: Robot) -> dict[str, float]:
    """Largest torque differences from Pinocchio over joints and random states, and the largest torque."""
    theta = link_parameters(robot.inertias.tensors()).numpy()
    compiled = inverse_dynamics(robot.tree, robot.inertias)
    functions = {
        "largest_n_m": lambda q, qd, qdd: np.zeros_like(q),
        "regressor_n_m": lambda *states: torque_regressor(robot.tree, *states) @ theta,
        "compiled_n_m": lambda *states: np.array([compiled(*state) for state in zip(*states, strict=True)]),
    }
    return {name: float(torque_differences(robot, torques).max()) for name, torques in functions.items()}
