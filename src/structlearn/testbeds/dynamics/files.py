"""The files of the dynamics stages: logs, models and tables, read as what they are.

Only the late stages (report, view) and the recordings read through here; those that compute name their files
themselves.
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import read_table
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.dynamics_models import DynamicsModels, read_dynamics_models
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.training_grid import Form
from structlearn.testbeds.dynamics.names import ROBOT

RAW, DATA = Path("data/raw/dynamics"), Path("data/dynamics")

ROBOT_LOGS, PAYLOAD_LOGS = RAW / ROBOT, RAW / "payload"
"""A folder per robot, the stand-ins or your own, and per stand-in that picks something up."""

TABLES = {
    "errors": DATA / "models/errors.parquet",
    "outcomes": DATA / "models/outcomes.parquet",
    "links": DATA / "models/links.parquet",
    "base": DATA / "models/base_parameters.parquet",
    "scores": DATA / "tracking/scores.parquet",
    "paths": DATA / "tracking/paths.parquet",
    "online": DATA / "online/errors.parquet",
    "payload": DATA / "online/payload.parquet",
}
"""By name; `rigid_body.training_grid`, `protocol.tracking` and `rigid_body.online_learning` say what is in
them."""


def read_tables(*names: str) -> dict[str, pd.DataFrame]:
    """Tables by name; all of `TABLES` where none is named.

    Raises:
        InputError: a file is missing or damaged.
    """
    return {name: read_table(TABLES[name]) for name in names or TABLES}


def robots() -> list[int]:
    """Seeds of the robots whose logs there are."""
    return sorted(int(folder.name) for folder in ROBOT_LOGS.iterdir())


def read_robot_motion(robot: int, cutoff_hz: float) -> tuple[Motion, float]:
    """A robot's log as models learned from it, and the s between its samples.

    Args:
        robot: one of `robots`.
        cutoff_hz: of the low-pass that it goes through.

    Raises:
        InputError: the log is missing or cannot be learned from.
    """
    log = read_joint_log(ROBOT_LOGS / str(robot) / "log.mcap")
    signals = (log.time, log.positions, log.velocities, log.torques)
    motion = measured_motion(log.name, *signals, cutoff_hz=cutoff_hz)
    return motion, float(log.time[-1] - log.time[0]) / (len(motion) - 1)


def read_payload_log() -> JointLog:
    """The log of the first robot that picks something up."""
    first = min(int(folder.name) for folder in PAYLOAD_LOGS.iterdir())
    return read_joint_log(PAYLOAD_LOGS / str(first) / "log.mcap")


def read_robot_models(robot: int, models: Sequence[str], form: Form) -> dict[str, DynamicsModels]:
    """Models that learned from a robot's log in a form, by name (`cov`, `cov_coulomb`).

    Raises:
        InputError: a file is missing or holds something else.
    """
    folder = DATA / "models" / ROBOT / str(robot) / form
    return {name: read_dynamics_models(folder / f"{name}.safetensors") for name in models}
