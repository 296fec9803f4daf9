"""Numbers of the dynamics testbed: what its stages wrote, what follows from it, and its metrics."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import COULOMB, STRICT, in_order
from structlearn.rigid_body.online_learning import OnlineParameters
from structlearn.rigid_body.seeded_training import SCHEDULED, DynamicsTrainingParameters
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

IDEAL, ROBOT = "iiwa", "stand_in"
"""The arm as its URDF has it, and the robot: the stand-in or a log of your own."""

SINE, REACH = "sine", "reach"
"""Tasks."""

STOPPED_NMSE = 1.0
"""What a run that had to be stopped counts at least: the error of an arm that does not move."""

SETTLED_SHARE = 0.05
"""Of a payload's mass; within it the learned mass counts as right."""


def first_run(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of a path up to where its time starts anew."""
    again = np.flatnonzero(np.diff(rows["time_s"]) <= 0.0)
    return rows.iloc[: again[0] + 1] if len(again) else rows


@dataclass(frozen=True)
class DynamicsResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        errors: of trainings by epoch, see `rigid_body.training.train`.
        outcomes: of trainings, see there.
        links: learned inertias beside the truth, see `inertia_tables.link_table`, with `model` and `loss`.
        base: learned base parameters beside the truth, see `inertia_tables.base_table`, likewise.
        scores: of tracking, see `simulation.tracking.track`.
        paths: of tracking, see there.
        online: errors while learning online, see `rigid_body.online.learn_once_through`.
        payload: what was learned of a payload, see `rigid_body.online.follow_payload`.
        agreement: a row per URDF, see `rigid_body.agreement.agreement_with_pinocchio`; `robot`, `joints`.
        known: errors of what is known on the robot's log, see `dynamics_robot.known_errors`.
        friction: learned friction of the robot, see `dynamics_robot.friction_table`.
        residuals: torques of the robot that are no rigid body's, see `dynamics_robot.residual_torques`.
        stand_in: the simulated robot; None: the robot's log is your own.
        motion: the sines.
        training: how models were trained.
        learning_online: how they learned online.
        tracking: how they were put to the test.
        carried: the payload.
    """

    errors: pd.DataFrame
    outcomes: pd.DataFrame
    links: pd.DataFrame
    base: pd.DataFrame
    scores: pd.DataFrame
    paths: pd.DataFrame
    online: pd.DataFrame
    payload: pd.DataFrame
    agreement: pd.DataFrame
    known: pd.DataFrame
    friction: pd.DataFrame
    residuals: pd.DataFrame
    stand_in: StandInParameters | None
    motion: SineParameters
    training: DynamicsTrainingParameters
    learning_online: OnlineParameters
    tracking: TrackingParameters
    carried: PayloadParameters

    @property
    def loss(self) -> str:
        """Loss of the models that were put to the test."""
        return self.tracking.loss

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of models that were trained, in the order of tables."""
        return in_order(self.outcomes["model"].unique())

    @cached_property
    def structures(self) -> list[str]:
        """Those of them that are inertias."""
        return [kind for kind in self.kinds if kind in STRUCTURES]

    @cached_property
    def strict(self) -> list[str]:
        """Those of `STRICT` that were trained."""
        return [kind for kind in self.kinds if kind in STRICT]

    @cached_property
    def rivals(self) -> list[str]:
        """The other kinds."""
        return [kind for kind in self.kinds if kind not in STRICT]

    def outcome(
        self, data: str, model: str, loss: str | None = None, optimiser: str = SCHEDULED
    ) -> pd.DataFrame:
        """Outcomes of a model (`cov`, `cov_coulomb`) by seed; empty where it was not trained.

        Epochs not reached are replaced by the most that it was given: a lower bound; `reached` says which.
        """
        rows = self._of(self.outcomes, data, model, loss or self.loss, optimiser)
        reached = rows["epochs"].notna()
        limits = self.training.epochs
        limit = limits.by_loss[loss or self.loss] if data == IDEAL else limits.robot
        return rows.assign(reached=reached, epochs=rows["epochs"].fillna(limit)).sort_values("seed")

    def kept_errors(self, data: str, model: str, loss: str | None = None) -> pd.DataFrame:
        """NMSE by seed (rows) and joint (columns, from 1) of the models that were kept."""
        rows = self._of(self.errors, data, model, loss or self.loss, SCHEDULED)
        needed = self._of(self.outcomes, data, model, loss or self.loss, SCHEDULED).set_index("seed")[
            "epochs"
        ]
        kept = rows["seed"].map(needed).fillna(rows["epoch"].max())
        return rows[rows["epoch"] == kept].pivot_table(index="seed", columns="joint", values="nmse")

    def runs(self, robot: str, model: str, task: str) -> pd.DataFrame:
        """Scores of a model in a task, by seed; those of stopped runs are at least `STOPPED_NMSE`."""
        scores = self.scores
        mask = (scores["robot"] == robot) & (scores["model"] == model) & (scores["task"] == task)
        rows = scores[mask].sort_values("seed").set_index("seed")
        columns = ["position_nmse", "velocity_nmse"]
        counted = rows[columns].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE)
        return rows.assign(**counted.where(rows["stopped"] != "", rows[columns]))

    def path(self, robot: str, model: str, task: str) -> pd.DataFrame:
        """Path of a model's first seed in a task, in the order of time."""
        paths = self.paths
        rows = paths[(paths["robot"] == robot) & (paths["model"] == model) & (paths["task"] == task)]
        return first_run(rows)

    def tracked(self, robot: str) -> list[str]:
        """Models that were put to the test with a robot, in the order of tables."""
        return in_order(self.scores.loc[self.scores["robot"] == robot, "model"].unique())

    def stopped(self, robot: str, model: str) -> int:
        """Number of runs of a model, sines and reaches, that had to be stopped."""
        return sum(int((self.runs(robot, model, task)["stopped"] != "").sum()) for task in (SINE, REACH))

    def velocity(self, model: str, robot: str = IDEAL) -> pd.Series:
        """NMSE of the tool's velocity in reaches, by seed."""
        return self.runs(robot, model, REACH)["velocity_nmse"]

    def robot_error(self, model: str) -> float:
        """NMSE on the robot's log, mean over joints and seeds, of a known or a learned model."""
        known = self.known[self.known["model"] == model]
        return float(known["nmse"].mean() if len(known) else self.outcome(ROBOT, model)["nmse_mean"].mean())

    @cached_property
    def robot_models(self) -> list[str]:
        """Models that learned from the robot's log, in the order of tables."""
        outcomes = self.outcomes[self.outcomes["data"] == ROBOT]
        names = outcomes["model"] + np.where(outcomes["friction"] == "coulomb", COULOMB, "")
        return in_order(names.unique())

    @cached_property
    def online_curves(self) -> pd.DataFrame:
        """NMSE, mean over the joints: `loss`, `model`, `seed`, `batch`, `nmse`."""
        keys = ["loss", "model", "seed", "batch"]
        return self.online.groupby(keys, sort=False)["nmse"].mean().reset_index()

    def online_scores(self, loss: str | None = None) -> pd.DataFrame:
        """Of learning online, by model and seed: `final` NMSE, and `speed`, mean log10 NMSE of batches."""
        curves = self.online_curves
        curves = curves[(curves["loss"] == (loss or self.loss)) & (curves["batch"] > 0)]
        curves = curves.assign(logarithm=np.log10(curves["nmse"]))
        by = curves.sort_values("batch").groupby(["model", "seed"])
        return pd.DataFrame({"final": by["nmse"].last(), "speed": by["logarithm"].mean()})

    @property
    def largest_disagreement(self) -> float:
        """Largest difference from Pinocchio in N m, of all ways and URDFs."""
        return float(self.agreement[["recursion_n_m", "regressor_n_m", "compiled_n_m"]].to_numpy().max())

    @cached_property
    def pick_up_s(self) -> float:
        """When the payload is picked up."""
        return self.carried.at_share * self.motion.duration_s

    @cached_property
    def settling_s(self) -> float | None:
        """Time from the pick-up until the learned mass stays right; None if it does not."""
        payload = self.payload[self.payload["time_s"] > self.pick_up_s]
        wrong = (payload["mass_kg"] - self.carried.mass_kg).abs() > SETTLED_SHARE * self.carried.mass_kg
        if wrong.iloc[-1]:
            return None
        settled = payload["time_s"][~wrong[::-1].cummax()[::-1]]
        return float(settled.iloc[0] - self.pick_up_s)

    @staticmethod
    def _of(table: pd.DataFrame, data: str, model: str, loss: str, optimiser: str) -> pd.DataFrame:
        kind = model.removesuffix(COULOMB)
        mask = (table["data"] == data) & (table["model"] == kind) & (table["loss"] == loss)
        mask &= (table["friction"] == "coulomb") == (model != kind)
        return table[mask & (table["optimiser"] == optimiser)]


def metrics(results: DynamicsResults) -> Metrics:
    """The flat metrics of the testbed.

    Models are those of the loss that tracks, the text's raw one. `epochs_<model>` is the mean over seeds of
    the epochs to the threshold on every joint in simulation; where it was not reached, `epochs_limit` counts.
    `ee_velocity_nmse_<model>` is the mean over seeds of the NMSE of the tool's velocity in reaches; a run
    that had to be stopped counts at least 1, and is one of `unstable_<model>` runs, sines and
    reaches. `robot_...` is the same of the stand-in, `robot_nmse_<model>` the NMSE on its log, mean over
    joints and seeds. `online_nmse_<model>` is that on the whole motion after one pass.
    """
    values: Metrics = {
        "simulated": True,
        "rnea_max_error_nm": results.largest_disagreement,
        "base_parameters": results.base["parameter"].nunique(),
        "epochs_limit": results.training.epochs.raw,
    }
    for kind in results.kinds:
        values[f"epochs_{kind}"] = results.outcome(IDEAL, kind, "raw")["epochs"].mean()
    for robot, prefix in ((IDEAL, ""), (ROBOT, "robot_")):
        for model in results.tracked(robot):
            values[f"{prefix}ee_velocity_nmse_{model}"] = results.velocity(model, robot).mean()
            values[f"{prefix}unstable_{model}"] = results.stopped(robot, model)
    for model in in_order([*results.known["model"], *results.robot_models]):
        if model in results.tracked(ROBOT) or not results.tracked(ROBOT):
            values[f"robot_nmse_{model}"] = results.robot_error(model)
    final = results.online_scores()["final"].groupby(level="model").mean()
    values |= {f"online_nmse_{model}": float(final[model]) for model in in_order(final.index)}
    values["payload_mass_error_kg"] = float(results.payload["mass_kg"].iloc[-1] - results.carried.mass_kg)
    values["payload_settling_s"] = results.settling_s
    return values
