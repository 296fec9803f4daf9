"""Files of the dynamics stages: logs, models and tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from structlearn.core.artefacts import read_table
from structlearn.readers.joint_log import JointLog, read_log_table
from structlearn.rigid_body.model_names import ROBOT
from structlearn.rigid_body.motion import Motion, measured_motion

if TYPE_CHECKING:  # torch takes a second to load, and recording stages only need paths
    from dissertation.dynamics.protocol.forms import Form
    from structlearn.rigid_body.dynamics_models import DynamicsModels

DATA = Path("data/dynamics")

TABLES = {
    "errors": "models/errors",
    "outcomes": "models/outcomes",
    "links": "models/links",
    "base": "models/base_parameters",
    "known": "models/known",
    "friction": "models/friction",
    "scores": "tracking/scores",
    "paths": "tracking/paths",
    "online": "online/errors",
    "payload": "online/payload",
}
"""Path of each table; columns: see `protocol.trainings`, `truth`, `tracking` and `rigid_body.payload`."""


def read_tables(*names: str) -> dict[str, pd.DataFrame]:
    """Read tables by name; all of `TABLES` if no names are given."""
    return {name: read_table(DATA / f"{TABLES[name]}.parquet") for name in names or TABLES}


def read_logs(kind: str) -> dict[str, JointLog]:
    """Logs of one kind (`IDEAL`, `ROBOT` or `payload`), keyed by name; a robot's log is named by its seed."""
    return {log.name: log for log in read_log_table(f"data/runs/dynamics/{kind}.parquet")}


def as_motion(log: JointLog, cutoff_hz: float = float("inf")) -> Motion:
    """Convert a log to a motion for learning, low-pass filtered at `cutoff_hz`."""
    signals = (log.time, log.positions, log.velocities, log.torques)
    return measured_motion(log.name, *signals, cutoff_hz=cutoff_hz)


def step_s(log: JointLog) -> float:
    """Mean sampling interval in s."""
    return float(log.time[-1]) / (len(log.time) - 1)


def read_robot_models(robot: int, models: Sequence[str], form: "Form") -> dict[str, "DynamicsModels"]:
    """Models that a robot's log trained in one form, keyed by name (`cov`, `cov_coulomb`)."""
    from structlearn.rigid_body.dynamics_models import read_dynamics_models

    folder = DATA / "models" / ROBOT / str(robot) / form
    return {name: read_dynamics_models(folder / f"{name}.safetensors") for name in models}
