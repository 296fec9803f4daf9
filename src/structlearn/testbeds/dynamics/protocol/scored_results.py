"""What the stages of the dynamics testbed wrote, and how it is scored: what counts, by model and seed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.rigid_body.model_names import COULOMB, STRICT, in_order
from structlearn.rigid_body.online_learning import OnlineParameters
from structlearn.rigid_body.seeded_training import SCHEDULED, DynamicsTrainingParameters
from structlearn.testbeds.dynamics.names import IDEAL, REACH, ROBOT, SINE
from structlearn.testbeds.dynamics.protocol.tracking import TrackingParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

STOPPED_NMSE = 1.0
"""What a run that had to be stopped counts at least: the error of an arm that does not move."""

SETTLED_SHARE = 0.05
"""Of a payload's mass; within it the learned mass counts as right."""


@dataclass(frozen=True)
class DynamicsResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        errors, outcomes: of trainings, see `rigid_body.seeded_training.train`.
        links, base: learned inertias and base parameters beside the truth, see `rigid_body.inertia_tables`,
            with `model` and `loss`.
        scores, paths: see `protocol.tracking.track`.
        online, payload: see `rigid_body.online_learning`.
        agreement: a row per URDF, see `rigid_body.agreement`, with `robot`.
        engines: how far the compiled arm is from PyBullet's, see `world.controlled_arm.agreement`.
        known, friction, residuals: of the robot's log, see `protocol.robot_behind_log`.
        stand_in: the simulated robot; None: the robot's log is your own.
        motion: the sines.
        training, learning_online, tracking: how models were trained, how online, how put to the test.
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
    engines: pd.DataFrame
    known: pd.DataFrame
    friction: pd.DataFrame
    residuals: pd.DataFrame
    stand_in: StandInParameters | None
    motion: SineParameters
    training: DynamicsTrainingParameters
    learning_online: OnlineParameters
    tracking: TrackingParameters
    carried: PayloadParameters

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of models that were trained, in the order of tables."""
        return in_order(self.outcomes["model"].unique())

    @cached_property
    def strict(self) -> list[str]:
        """Those of `STRICT` that were trained."""
        return [kind for kind in self.kinds if kind in STRICT]

    def outcome(
        self, data: str, model: str, loss: str | None = None, optimiser: str = SCHEDULED
    ) -> pd.DataFrame:
        """Outcomes of a model (`cov`, `cov_coulomb`) by seed; empty where it was not trained.

        Epochs not reached are replaced by the most that it was given: a lower bound; `reached` says which.
        """
        rows = self._trained(self.outcomes, data, model, loss, optimiser)
        limits = self.training.epochs
        limit = limits.by_loss[loss or self.tracking.loss] if data == IDEAL else limits.robot
        epochs, reached = rows["epochs"].fillna(limit), rows["epochs"].notna()
        return rows.assign(epochs=epochs, reached=reached).set_index("seed").sort_index()

    def kept_errors(self, data: str, model: str) -> pd.DataFrame:
        """NMSE by seed (rows) and joint (columns, from 1) of the models that were kept."""
        rows = self._trained(self.errors, data, model)
        needed = self._trained(self.outcomes, data, model).set_index("seed")["epochs"]
        kept = rows["seed"].map(needed).fillna(rows["epoch"].max())
        return rows[rows["epoch"] == kept].pivot_table(index="seed", columns="joint", values="nmse")

    def runs(self, robot: str, model: str, task: str) -> pd.DataFrame:
        """Scores of a model in a task, by seed; those of stopped runs are at least `STOPPED_NMSE`."""
        found = self._runs.get((robot, model, task))
        return self.scores.set_index("seed").iloc[:0] if found is None else found

    def tracked(self, robot: str) -> list[str]:
        """Models that were put to the test with a robot, in the order of tables."""
        return in_order(self.scores.loc[self.scores["robot"] == robot, "model"].unique())

    def stopped(self, robot: str, model: str, *tasks: str) -> int:
        """Number of runs of a model in some tasks (default: sines and reaches) that had to be stopped."""
        every = (self.runs(robot, model, task)["stopped"] != "" for task in tasks or (SINE, REACH))
        return int(sum(stopped.sum() for stopped in every))

    def count(self, robot: str, model: str, *tasks: str) -> int:
        """Number of runs of a model in some tasks (default: sines and reaches)."""
        return sum(len(self.runs(robot, model, task)) for task in tasks or (SINE, REACH))

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
        curves = curves[(curves["loss"] == (loss or self.tracking.loss)) & (curves["batch"] > 0)]
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

    @cached_property
    def _runs(self) -> dict[tuple[str, str, str], pd.DataFrame]:
        """See `runs`, by its arguments; pages ask for them hundreds of times."""
        columns = ["position_nmse", "velocity_nmse"]
        scores = self.scores.sort_values("seed").set_index("seed")
        counted = scores[columns].fillna(STOPPED_NMSE).clip(lower=STOPPED_NMSE)
        scores = scores.assign(**counted.where(scores["stopped"] != "", scores[columns]))
        return dict(iter(scores.groupby(["robot", "model", "task"])))

    def _trained(
        self, table: pd.DataFrame, data: str, model: str, loss: str | None = None, optimiser: str = SCHEDULED
    ) -> pd.DataFrame:
        kind = model.removesuffix(COULOMB)
        mask = (table["data"] == data) & (table["model"] == kind) & (table["optimiser"] == optimiser)
        mask &= (table["friction"] == "coulomb") == (model != kind)
        return table[mask & (table["loss"] == (loss or self.tracking.loss))]
