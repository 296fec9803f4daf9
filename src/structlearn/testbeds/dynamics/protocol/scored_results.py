"""Outputs of the stages of the dynamics testbed, and how it is scored: what counts, by model and seed."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.metrics import nmse
from structlearn.rigid_body.compiled_dynamics import friction_rows
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT, in_order
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.training_grid import LOSSES, TEXT, Form
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Mechanics
from structlearn.testbeds.dynamics.names import REACH, SINE
from structlearn.testbeds.dynamics.protocol.tracking import KNOWN

STOPPED_NMSE = 1.0
"""What a run that had to be stopped counts at least: the error of an arm that does not move."""

SETTLED_SHARE = 0.1
"""Of a payload's mass; within it the learned mass counts as right, batch by batch."""

TERMS: tuple[FrictionTerm, ...] = ("viscous", "coulomb")
"""Of friction that a true robot has."""

RESIDUAL_RATE_HZ = 10.0
"""Of residual torques that are kept to be drawn."""


@dataclass(frozen=True)
class DynamicsResults:
    """Outputs of the stages of the testbed, and what follows from it.

    Of robots a seed is that of the robot; in simulation it is that of a model's start and of its goals.
    """

    errors: pd.DataFrame  # of trainings, see `rigid_body.training_grid.train`
    outcomes: pd.DataFrame
    links: pd.DataFrame  # learned beside the truth, see `rigid_body.base_parameters`, with `model`, `form`
    base: pd.DataFrame
    scores: pd.DataFrame  # see `protocol.tracking.track`
    paths: pd.DataFrame
    online: pd.DataFrame  # see `rigid_body.online_learning`
    payload: pd.DataFrame  # likewise, with `seed`
    agreement: pd.DataFrame  # a row per URDF, see `rigid_body.newton_euler`, with `robot`
    known: pd.DataFrame  # of robots' logs, see this module, with `seed`
    friction: pd.DataFrame
    residuals: pd.DataFrame  # likewise, of the first robot
    chosen: Mapping[str, Any]  # parameters by their key in `params.yaml`
    trials: pd.DataFrame | None = None  # of our optimiser, of the study `dynamics/optimiser`; None: not run

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of models that were trained, in the order of tables."""
        return in_order(self.outcomes["model"].str.removesuffix(COULOMB).unique())

    @cached_property
    def robot_models(self) -> list[str]:
        """Models that learned from robots' logs, in the order of tables."""
        return in_order(self.outcomes.loc[self.outcomes["arm"] == ROBOT, "model"].unique())

    def tracked(self, arm: str) -> list[str]:
        """Models that were put to the test with an arm in any form, in the order of tables."""
        return in_order(self.scores.loc[self.scores["robot"] == arm, "model"].unique())

    def outcome(self, arm: str, model: str, form: Form = TEXT) -> pd.DataFrame:
        """Outcomes of a model (`cov`, `cov_coulomb`) by seed; empty where it was not trained.

        Epochs not reached are replaced by the most that it was given: a lower bound; `reached` says which.
        """
        return self._outcomes.get((arm, model, form), self._outcomes["none"])

    def runs(self, arm: str, model: str, task: str, form: Form = TEXT) -> pd.DataFrame:
        """Scores of a model in a task, by seed; those of stopped runs are at least `STOPPED_NMSE`.

        Models that did not meet the criterion have none.
        """
        known = self._runs.get((arm, model, task, KNOWN))
        return self._runs.get((arm, model, task, form), self._runs["none"]) if known is None else known

    def stopped(self, arm: str, model: str, form: Form = TEXT) -> tuple[int, int]:
        """Number of runs of a model, sines and reaches, that had to be stopped, and number of all."""
        halted = pd.concat([self.runs(arm, model, task, form)["stopped"] for task in (SINE, REACH)]) != ""
        return int(halted.sum()), len(halted)

    def robot_error(self, model: str, form: Form = TEXT) -> pd.Series:
        """NMSE on robots' logs, mean over joints, of a known or a learned model, by robot."""
        if model in (GROUND_TRUTH, DEFAULT):
            return self.known[self.known["model"] == model].groupby("seed")["nmse"].mean()
        return self.outcome(ROBOT, model, form)["nmse_mean"]

    @cached_property
    def online_curves(self) -> pd.DataFrame:
        """NMSE, mean over the joints: `loss`, `model`, `seed`, `batch`, `nmse`."""
        keys = ["loss", "model", "seed", "batch"]
        return self.online.groupby(keys, sort=False)["nmse"].mean().reset_index()

    def online_scores(self, form: Form = TEXT) -> pd.DataFrame:
        """Of learning online, by model and seed: `final` NMSE, and `speed`, mean log10 NMSE of batches."""
        curves = self.online_curves
        curves = curves[(curves["loss"] == LOSSES[form]) & (curves["batch"] > 0)]
        curves = curves.assign(logarithm=np.log10(curves["nmse"]))
        by = curves.sort_values("batch").groupby(["model", "seed"])
        return pd.DataFrame({"final": by["nmse"].last(), "speed": by["logarithm"].mean()})

    @cached_property
    def pick_up_s(self) -> float:
        """When payloads are picked up."""
        motion = self.chosen["arm_motion"].used.cut(self.chosen["stand_in"].log_s)
        return self.chosen["record_motion"].payload.at_share * motion.duration_s

    @cached_property
    def settling_s(self) -> pd.Series:
        """By robot, time from the pick-up until the learned mass stays right; NaN if it does not."""
        mass_kg, found = self.chosen["record_motion"].payload.mass_kg, {}
        for seed, its in self.payload[self.payload["time_s"] > self.pick_up_s].groupby("seed"):
            wrong = (its["mass_kg"] - mass_kg).abs() > SETTLED_SHARE * mass_kg
            settled = its["time_s"][~wrong[::-1].cummax()[::-1]]
            found[seed] = settled.iloc[0] - self.pick_up_s if len(settled) else np.nan
        return pd.Series(found, dtype=float)

    @cached_property
    def mass_errors(self) -> pd.Series:
        """By robot, share by which the payload's mass is wrong, averaged over the second half of its time."""
        late = 0.5 * (self.pick_up_s + self.payload["time_s"].max())
        mass = self.payload[self.payload["time_s"] > late].groupby("seed")["mass_kg"].mean()
        return (mass / self.chosen["record_motion"].payload.mass_kg - 1.0).abs()

    @cached_property
    def _outcomes(self) -> dict[Any, pd.DataFrame]:
        """See `outcome`, by its arguments; `none` is empty."""
        limits, rows = (
            self.chosen["train_dynamics"].epochs,
            self.outcomes.sort_values("seed").set_index("seed"),
        )
        most = np.where(rows["arm"] == IDEAL, limits.simulation, limits.robot)
        reached = rows["epochs"].notna()
        rows = rows.assign(epochs=rows["epochs"].where(reached, most), reached=reached)
        return {**dict(iter(rows.groupby(["arm", "model", "form"]))), "none": rows.iloc[:0]}

    @cached_property
    def _runs(self) -> dict[Any, pd.DataFrame]:
        """See `runs`, by its arguments; pages ask for them hundreds of times."""
        columns = ["position_nmse", "velocity_nmse"]
        scores = self.scores.sort_values("seed").set_index("seed")
        counted = scores[columns].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE)
        scores = scores.assign(**counted.where(scores["stopped"] != "", scores[columns]))
        by = scores.groupby(["robot", "model", "task", "form"])
        return {**dict(iter(by)), "none": scores.iloc[:0]}


def known_errors(robot: Robot, mechanics: Mechanics, motion: Motion) -> pd.DataFrame:
    """Errors of what is known instead of learned: of the truth, and of the URDF, the default model.

    Returns:
        `model`, `joint` (from 1), `nmse`.
    """
    rubbing = np.stack([mechanics.viscous, mechanics.coulomb], axis=-1)
    friction = np.einsum("tjk,jk->tj", friction_columns(motion.qd, TERMS), rubbing)
    torques = {
        GROUND_TRUTH: rigid_body_torques(robot.tree, mechanics.inertias, motion) + friction,
        DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion),
    }
    errors = pd.DataFrame({name: nmse(found, motion.torque) for name, found in torques.items()})
    errors["joint"] = np.arange(1, motion.joints + 1)
    return errors.melt("joint", var_name="model", value_name="nmse")[["model", "joint", "nmse"]]


def friction_table(models: Mapping[str, DynamicsModels], mechanics: Mechanics) -> pd.DataFrame:
    """Friction that models, the first one of each, learned of one robot, beside what really rubs.

    Returns:
        `model`, `joint` (from 1), `term`, `value` in N m s/rad or N m, and `truth`.
    """
    rows = []
    for name, its in models.items():
        learned = friction_rows(its.friction_coefficients()[0], its.friction)
        for place, term in enumerate(TERMS):
            if term in its.friction:
                pairs = zip(learned[place], getattr(mechanics, term), strict=True)
                rows += [(name, joint, term, *pair) for joint, pair in enumerate(pairs, start=1)]
    return pd.DataFrame(rows, columns=["model", "joint", "term", "value", "truth"])


def residual_torques(robot: Robot, models: DynamicsModels, motion: Motion, rate_hz: float) -> pd.DataFrame:
    """What is left of measured torques without the bodies of the first of some models: friction and noise.

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
