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
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, IDEAL, ROBOT, STRICT, in_order
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.online_learning import OnlineParameters
from structlearn.rigid_body.training_grid import LOSSES, TEXT, DynamicsTrainingParameters, Form
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import Mechanics
from structlearn.testbeds.dynamics.names import REACH, SINE
from structlearn.testbeds.dynamics.protocol.tracking import KNOWN, TrackingParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.testbeds.dynamics.world.perturbed_robot import StandInParameters

STOPPED_NMSE = 1.0
"""What a run that had to be stopped counts at least: the error of an arm that does not move."""

SETTLED_SHARE = 0.1
"""Of a payload's mass; within it the learned mass counts as right, batch by batch."""


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
    stand_in: StandInParameters  # what robots have in common
    motion: SineParameters
    training: DynamicsTrainingParameters
    learning_online: OnlineParameters
    tracking: TrackingParameters
    carried: PayloadParameters
    trials: pd.DataFrame | None = None  # of our optimiser, of the study `dynamics/optimiser`; None: not run

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of models that were trained, in the order of tables."""
        return in_order(self.outcomes["model"].str.removesuffix(COULOMB).unique())

    @cached_property
    def strict(self) -> list[str]:
        """Those of `STRICT` that were trained."""
        return [kind for kind in self.kinds if kind in STRICT]

    @cached_property
    def robots(self) -> list[int]:
        """Seeds of the robots."""
        return sorted(int(seed) for seed in self.outcomes[self.outcomes["arm"] == ROBOT]["seed"].unique())

    def outcome(self, arm: str, model: str, form: Form = TEXT) -> pd.DataFrame:
        """Outcomes of a model (`cov`, `cov_coulomb`) by seed; empty where it was not trained.

        Epochs not reached are replaced by the most that it was given: a lower bound; `reached` says which.
        """
        return self._outcomes.get((arm, model, form), self._outcomes["none"])

    def kept_errors(self, arm: str, model: str, form: Form = TEXT) -> pd.DataFrame:
        """NMSE by seed (rows) and joint (columns, from 1) of the models that were kept."""
        rows = _of(self.errors, arm, model, form)
        last = rows["epoch"].max()
        needed = _of(self.outcomes, arm, model, form).set_index("seed")["epochs"]
        kept = rows["seed"].map(needed).fillna(last) if arm == IDEAL else last
        return rows[rows["epoch"] == kept].pivot_table(index="seed", columns="joint", values="nmse")

    def runs(self, arm: str, model: str, task: str, form: Form = TEXT) -> pd.DataFrame:
        """Scores of a model in a task, by seed; those of stopped runs are at least `STOPPED_NMSE`.

        Models that did not meet the criterion have none.
        """
        keys = ((arm, model, task, its) for its in (KNOWN, form))
        empty = self.scores.set_index("seed").iloc[:0]
        return next((self._runs[key] for key in keys if key in self._runs), empty)

    def tracked(self, arm: str) -> list[str]:
        """Models that were put to the test with an arm in any form, in the order of tables."""
        return in_order(self.scores.loc[self.scores["robot"] == arm, "model"].unique())

    def stopped(self, arm: str, model: str, form: Form = TEXT) -> int:
        """Number of runs of a model, sines and reaches, that had to be stopped."""
        return sum(int((self.runs(arm, model, task, form)["stopped"] != "").sum()) for task in (SINE, REACH))

    def count(self, arm: str, model: str, form: Form = TEXT) -> int:
        """Number of runs of a model, sines and reaches."""
        return sum(len(self.runs(arm, model, task, form)) for task in (SINE, REACH))

    def velocity(self, arm: str, model: str, form: Form = TEXT) -> pd.Series:
        """NMSE of the tool's velocity in reaches, by seed."""
        return self.runs(arm, model, REACH, form)["velocity_nmse"]

    def robot_error(self, model: str, form: Form = TEXT) -> pd.Series:
        """NMSE on robots' logs, mean over joints, of a known or a learned model, by robot."""
        known = self._known_errors.get(model)
        return known if known is not None else self.outcome(ROBOT, model, form)["nmse_mean"]

    @cached_property
    def robot_models(self) -> list[str]:
        """Models that learned from robots' logs, in the order of tables."""
        return in_order(self.outcomes.loc[self.outcomes["arm"] == ROBOT, "model"].unique())

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

    @property
    def largest_disagreement(self) -> float:
        """Largest difference from Pinocchio in N m, of all ways and URDFs."""
        return float(self.agreement[["recursion_n_m", "regressor_n_m", "compiled_n_m"]].to_numpy().max())

    @cached_property
    def pick_up_s(self) -> float:
        """When payloads are picked up."""
        return self.carried.at_share * self.motion.cut(self.stand_in.log_s).duration_s

    @cached_property
    def settling_s(self) -> pd.Series:
        """By robot, time from the pick-up until the learned mass stays right; NaN if it does not."""
        after = self.payload[self.payload["time_s"] > self.pick_up_s]
        return pd.Series({seed: self._settling_s(its) for seed, its in after.groupby("seed")})

    def _settling_s(self, payload: pd.DataFrame) -> float:
        wrong = (payload["mass_kg"] - self.carried.mass_kg).abs() > SETTLED_SHARE * self.carried.mass_kg
        if wrong.iloc[-1]:
            return np.nan
        settled = payload["time_s"][~wrong[::-1].cummax()[::-1]]
        return float(settled.iloc[0] - self.pick_up_s)

    @cached_property
    def mass_errors(self) -> pd.Series:
        """By robot, share by which the payload's mass is wrong, averaged over the second half of its time."""
        late = 0.5 * (self.pick_up_s + self.payload["time_s"].max())
        mass = self.payload[self.payload["time_s"] > late].groupby("seed")["mass_kg"].mean()
        return (mass / self.carried.mass_kg - 1.0).abs()

    @cached_property
    def _outcomes(self) -> dict[Any, pd.DataFrame]:
        """See `outcome`, by its arguments; `none` is empty."""
        limits, rows = self.training.epochs, self.outcomes.sort_values("seed").set_index("seed")
        most = np.where(rows["arm"] == IDEAL, limits.simulation, limits.robot)
        rows = rows.assign(
            epochs=rows["epochs"].where(rows["epochs"].notna(), most), reached=rows["epochs"].notna()
        )
        return {**dict(iter(rows.groupby(["arm", "model", "form"]))), "none": rows.iloc[:0]}

    @cached_property
    def _known_errors(self) -> dict[Any, pd.Series]:
        """By model that is known, its NMSE by robot."""
        means = self.known.groupby(["model", "seed"])["nmse"].mean()
        return {model: its.droplevel("model") for model, its in means.groupby(level="model")}

    @cached_property
    def _runs(self) -> dict[tuple[str, str, str, str], pd.DataFrame]:
        """See `runs`, by its arguments; pages ask for them hundreds of times."""
        columns = ["position_nmse", "velocity_nmse"]
        scores = self.scores.sort_values("seed").set_index("seed")
        counted = scores[columns].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE)
        scores = scores.assign(**counted.where(scores["stopped"] != "", scores[columns]))
        return dict(iter(scores.groupby(["robot", "model", "task", "form"])))


def _of(table: pd.DataFrame, arm: str, model: str, form: Form) -> pd.DataFrame:
    return table[(table["arm"] == arm) & (table["model"] == model) & (table["form"] == form)]


TERMS: tuple[FrictionTerm, ...] = ("viscous", "coulomb")
"""Of friction that a true robot has."""

RESIDUAL_RATE_HZ = 10.0
"""Of residual torques that are kept to be drawn."""


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
    tables = [
        pd.DataFrame(
            {"model": name, "joint": np.arange(1, motion.joints + 1), "nmse": nmse(found, motion.torque)}
        )
        for name, found in torques.items()
    ]
    return pd.concat(tables, ignore_index=True)


def friction_table(models: Mapping[str, DynamicsModels], mechanics: Mechanics) -> pd.DataFrame:
    """Friction that models, the first one of each, learned of one robot, beside what really rubs.

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
