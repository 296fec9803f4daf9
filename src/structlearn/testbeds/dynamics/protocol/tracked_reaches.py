"""The reaches of an arm with one model in its controller, out of the tables of `tracking`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.rigid_body.model_names import model_name
from structlearn.rigid_body.training_grid import Form
from structlearn.testbeds.dynamics.protocol.tracking import KNOWN


@dataclass(frozen=True)
class TrackedReach:
    """The reaches of a model's shown seed.

    Attributes:
        model: its key.
        time: (T,) s.
        joints: (T, n) rad.
        tool: (T, 3) m, base frame.
        wanted: (T, 3) m, where the tool should be.
        velocity_nmse: of the tool; NaN where it was stopped.
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
        return _speed(self.tool, self.time), _speed(self.wanted, self.time)


def tracked_reaches(
    paths: pd.DataFrame,
    scores: pd.DataFrame,
    robot: str,
    form: Form,
    models: Sequence[str],
    joints: Sequence[str] = (),
) -> list[TrackedReach]:
    """The reaches of each model's shown seed; models that did not track with this robot are left out.

    Args:
        paths: of `tracking.track`, of the shown seed, which is the first.
        scores: of `tracking.track`.
        robot: the arm's name there.
        form: of the models that were learned.
        models: keys in their order.
        joints: columns of the paths.
    """
    chosen = [(model, *(_chosen(table, robot, form, model) for table in (paths, scores))) for model in models]
    return [_reach(model, path, score, joints) for model, path, score in chosen if len(path)]


def _reach(model: str, rows: pd.DataFrame, scores: pd.DataFrame, joints: Sequence[str]) -> TrackedReach:
    first = scores.sort_values("seed").iloc[0]
    tool, wanted = (
        rows[[f"{prefix}_{axis}" for axis in "xyz"]].to_numpy(float) for prefix in ("tool", "wanted")
    )
    time, angles = rows["time_s"].to_numpy(float), rows[list(joints)].to_numpy(float)
    return TrackedReach(model, time, angles, tool, wanted, float(first["velocity_nmse"]), first["stopped"])


def _chosen(table: pd.DataFrame, robot: str, form: Form, model: str) -> pd.DataFrame:
    reaches = table[(table["robot"] == robot) & (table["model"] == model) & (table["task"] == "reach")]
    return reaches[reaches["form"].isin((form, KNOWN))]


def _speed(points: np.ndarray, time: np.ndarray) -> np.ndarray:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(time)
    return np.concatenate([[0.0], steps])
