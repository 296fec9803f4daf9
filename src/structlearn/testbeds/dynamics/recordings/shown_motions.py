"""Which motions of an arm the recordings show, from the files of the dynamics stages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.palette import BLUE, GREEN, GREY, LIGHT_GREY, ORANGE, PURPLE, SKY, VERMILION
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, model_name
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.prediction import predicted_torques, rigid_body_torques
from structlearn.rigid_body.tree import Robot

COLOURS = {
    GROUND_TRUTH: LIGHT_GREY,
    DEFAULT: GREY,
    "mlp": VERMILION,
    "mlp_scaled": ORANGE,
    "delan": PURPLE,
    "nostr": GREEN,
}
"""Of models on a dark ground; the other structures are `STRUCTURED`, with Coulomb friction `RUBBING`."""

STRUCTURED, RUBBING = SKY, BLUE

COLOUR_WORDS = {
    LIGHT_GREY: "white",
    GREY: "grey",
    VERMILION: "red",
    ORANGE: "orange",
    PURPLE: "pink",
    GREEN: "green",
    SKY: "light blue",
    BLUE: "blue",
}


class DynamicsViewParameters(Parameters):
    """What the recordings show.

    Attributes:
        models: that reach with the arm; each has an arm of its own in the recording.
        robot_models: that reach with the stand-in.
        torque_models: whose torques are shown beside measured ones, learned from the robot's log.
        torques_s: of the robot's log, from its start.
        rate_hz: of torques and of the payload's motion.
        payload_s: before and after the pick-up.
    """

    models: tuple[str, ...] = Field(default=(GROUND_TRUTH, "mlp", "delan", "cov"), min_length=1)
    robot_models: tuple[str, ...] = Field(default=(DEFAULT, "mlp", "delan", "cov_coulomb"), min_length=1)
    torque_models: tuple[str, ...] = Field(default=("mlp", "delan", "cov", "cov_coulomb"), min_length=1)
    torques_s: float = Field(default=60.0, gt=0)
    rate_hz: float = Field(default=25.0, gt=0)
    payload_s: float = Field(default=20.0, gt=0)


@dataclass(frozen=True)
class Reaching:
    """The reaches of an arm with one model in its controller.

    Attributes:
        model: its name.
        time: (T,) s.
        joints: (T, n) rad.
        tool: (T, 3) m, base frame.
        wanted: (T, 3) m, where the tool should be.
        velocity_nmse: of the tool.
        stopped: why it was stopped; empty where it ran through.
    """

    model: str
    time: np.ndarray
    joints: np.ndarray
    tool: np.ndarray
    wanted: np.ndarray
    velocity_nmse: float
    stopped: str

    @property
    def label(self) -> str:
        """Name of the model."""
        return model_name(self.model)

    @property
    def off_mm(self) -> np.ndarray:
        """(T,) distance of the tool from where it should be."""
        return 1e3 * np.linalg.norm(self.tool - self.wanted, axis=1)

    @property
    def speeds(self) -> tuple[np.ndarray, np.ndarray]:
        """(T,) m/s of the tool, and as it should be; 0 at the start."""
        return tuple(_speed(points, self.time) for points in (self.tool, self.wanted))


@dataclass(frozen=True)
class ShownTorques:
    """A robot's motion with its torques, measured and by models.

    Attributes:
        joints: (n,) names.
        time: (T,) s.
        q: (T, n) rad.
        tool: (T, 3) m, base frame.
        measured: (T, n) N m.
        predicted: by model, (T, n) N m.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    q: np.ndarray
    tool: np.ndarray
    measured: np.ndarray
    predicted: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class ShownPayload:
    """An arm that picks up a payload, and what is learned of it.

    Attributes:
        joints: (n,) names.
        time: (T,) s.
        q: (T, n) rad.
        body: (T, 3) m, the payload's centre of mass once it is carried, base frame.
        pick_up_s: when that is.
        mass_kg: of the payload.
        learned: see `rigid_body.online.follow_payload`.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    q: np.ndarray
    body: np.ndarray
    pick_up_s: float
    mass_kg: float
    learned: pd.DataFrame


def reaching(
    paths: pd.DataFrame, scores: pd.DataFrame, robot: str, models: Sequence[str], joints: Sequence[str]
) -> list[Reaching]:
    """The reaches of each model's first seed; models that did not track with this robot are left out.

    Args:
        paths: of `simulation.tracking.track`.
        scores: of `simulation.tracking.track`.
        robot: the arm's name there.
        models: names in their order.
        joints: columns of the paths.
    """
    found = []
    for model in models:
        rows, score = (
            table[(table["robot"] == robot) & (table["model"] == model) & (table["task"] == "reach")]
            for table in (paths, scores)
        )
        if rows.empty:
            continue
        again = np.flatnonzero(np.diff(rows["time_s"]) <= 0.0)  # the next seed
        rows = rows.iloc[: again[0] + 1] if len(again) else rows
        first = score.sort_values("seed").iloc[0]
        tool, wanted = (
            rows[[f"{prefix}_{axis}" for axis in "xyz"]].to_numpy(float) for prefix in ("tool", "wanted")
        )
        found.append(
            Reaching(
                model,
                rows["time_s"].to_numpy(float),
                rows[list(joints)].to_numpy(float),
                tool,
                wanted,
                float(first["velocity_nmse"]),
                first["stopped"],
            )
        )
    return found


def shown_torques(
    robot: Robot,
    motion: Motion,
    dt: float,
    models: Mapping[str, DynamicsModels],
    tool_m: tuple[float, float, float],
) -> ShownTorques:
    """Torques of the URDF and of the first seed of learned models beside the measured ones.

    Args:
        robot: by its URDF.
        motion: of the robot.
        dt: s between its samples.
        models: by name.
        tool_m: tool point in the last joint's frame.
    """
    predicted = {DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion)}
    predicted |= {name: predicted_torques(its, robot.tree, motion)[0] for name, its in models.items()}
    time = dt * np.arange(len(motion))
    tool, _ = tool_motion(robot.tree, tool_m, motion.q, motion.qd)
    return ShownTorques(robot.tree.names, time, motion.q, tool, motion.torque, predicted)


def colour(model: str) -> str:
    """Colour of a model."""
    return RUBBING if model.endswith(COULOMB) else COLOURS.get(model, STRUCTURED)


def _speed(points: np.ndarray, time: np.ndarray) -> np.ndarray:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(time)
    return np.concatenate([[0.0], steps])
