"""What is known of the robots behind logs, beside what was learned from them: errors and friction."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from structlearn.ground.metrics import nmse
from structlearn.rigid_body.compiled_dynamics import friction_rows
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Mechanics

TERMS: tuple[FrictionTerm, ...] = ("viscous", "coulomb")
"""Of friction that a true robot has."""

RESIDUAL_RATE_HZ = 10.0
"""Of residual torques that are kept to be drawn."""


def known_errors(robot: Robot, mechanics: Mechanics, motion: Motion) -> pd.DataFrame:
    """Errors of models that are known instead of learned.

    Args:
        robot: as its URDF describes it: the default model.
        mechanics: what really moved.
        motion: of the log.

    Returns:
        `model`, `joint` (from 1), `nmse`.
    """
    rubbing = np.stack([mechanics.viscous, mechanics.coulomb], axis=-1)
    friction = np.einsum("tjk,jk->tj", friction_columns(motion.qd, TERMS), rubbing)
    torques = {
        GROUND_TRUTH: rigid_body_torques(robot.tree, mechanics.inertias, motion) + friction,
        DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion),
    }
    tables = [
        pd.DataFrame(
            {"model": name, "joint": np.arange(1, motion.joints + 1), "nmse": nmse(found, motion.torque)}
        )
        for name, found in torques.items()
    ]
    return pd.concat(tables, ignore_index=True)


def friction_table(models: Mapping[str, DynamicsModels], mechanics: Mechanics) -> pd.DataFrame:
    """Friction that models learned of one robot.

    Args:
        models: by name, the first one of each; those that learned no friction have no rows.
        mechanics: what really rubs.

    Returns:
        `model`, `joint` (from 1), `term`, `value` in N m s/rad or N m, and `truth`.
    """
    rows = []
    for name, its in models.items():
        coefficients = its.friction_coefficients()[0]
        learned = friction_rows(coefficients, its.friction)
        for term in (term for term in TERMS if term in its.friction):
            true = getattr(mechanics, term)
            for joint, value in enumerate(learned[TERMS.index(term)]):
                rows.append((name, joint + 1, term, value, true[joint]))
    return pd.DataFrame(rows, columns=["model", "joint", "term", "value", "truth"])


def residual_torques(robot: Robot, models: DynamicsModels, motion: Motion, rate_hz: float) -> pd.DataFrame:
    """What is left of measured torques without a learned model's rigid bodies: friction and noise.

    Args:
        robot: of the log.
        models: structured, with friction; the first one is taken.
        motion: of the log.
        rate_hz: of the motion.

    Returns:
        At `RESIDUAL_RATE_HZ`: `joint` (from 1), `velocity_rad_s`, `residual_n_m` and `friction_n_m`, the
        model's.
    """
    kept = motion.part(slice(None, None, max(1, round(rate_hz / RESIDUAL_RATE_HZ))))
    links = rigid_body_torques(robot.tree, models.inertias(), kept)[0]
    friction = predicted_torques(models, robot.tree, kept)[0] - links
    return pd.DataFrame(
        {
            "joint": np.tile(np.arange(1, kept.joints + 1), len(kept)),
            "velocity_rad_s": kept.qd.ravel(),
            "residual_n_m": (kept.torque - links).ravel(),
            "friction_n_m": friction.ravel(),
        }
    )
