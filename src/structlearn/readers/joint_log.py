"""Joint logs: motion with torques or motor currents on one clock, and the names of the joints.

A dynamics model is learned from joints alone, so a log needs no end-effector pose, unlike a `Recording`.
Stages exchange logs as tables; a robot's own log is a bag (`bag_recording.read_joint_log`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.clock import at_row
from structlearn.readers.demonstration import Series, columns_of, each_series, write_series

if TYPE_CHECKING:
    from structlearn.readers.joint_streams import JointSeries

UNITS = {
    "stamps": "ns",
    "positions": "rad",
    "velocities": "rad/s",
    "torques": "N m",
    "currents": "A",
    "desired_currents": "A",
    "target_torques": "N m",
    "accelerations": "rad/s^2",
    "inertial": "N m",
    "coriolis": "N m",
    "gravity": "N m",
}  # for revolute joints


@dataclass(frozen=True)
class MotionLog:
    """Motion of joints as recorded, at possibly irregular times."""

    name: str  # unique within its set
    joints: tuple[str, ...]  # (n,) names in the order of the columns
    stamps: np.ndarray  # (T,) int64 ns, increasing
    positions: np.ndarray  # (T, n) rad (m for prismatic joints)
    velocities: np.ndarray  # (T, n) rad/s
    # what is known of the origin; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        """Raise InputError, naming log and row: wrong shapes, stamps that do not increase, or NaN."""
        count, width = len(self.stamps), len(self.joints)
        if count < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {count}")
        if (late := np.diff(self.stamps) <= 0).any():
            row = at_row(int(np.argmax(late)) + 1, self.stamps)
            raise InputError(f"{self.name}: {row} does not come after the one before it")
        for signal in signals_of(type(self)):
            values = getattr(self, signal)
            if values.shape != (count, width):
                raise InputError(
                    f"{self.name}: {signal} have shape {values.shape}, not {count} samples of {width} joints"
                )
            if not np.isfinite(values).all():
                row, column = np.argwhere(~np.isfinite(values))[0]
                raise InputError(
                    f"{self.name}: {at_row(int(row), self.stamps)}: {signal} of joint "
                    f"'{self.joints[column]}' are {values[row, column]}"
                )

    @property
    def time(self) -> np.ndarray:
        """(T,) s since the first sample."""
        return (self.stamps - self.stamps[0]) * 1e-9


@dataclass(frozen=True)
class JointLog(MotionLog):
    """A log with torques (T, n) in N m, positive if they accelerate the joint in its positive direction."""

    torques: np.ndarray


@dataclass(frozen=True)
class DriveLog(MotionLog):
    """A log of an arm without torque sensors; a drive's torque is a gain times its current."""

    currents: np.ndarray  # (T, n) A, measured
    desired_currents: np.ndarray  # (T, n) A, set by the controller
    target_torques: np.ndarray  # (T, n) N m, computed by the controller, not measured


@dataclass(frozen=True)
class PartedLog(JointLog):
    """A simulated log, with accelerations and the additive parts of the torques, (T, n) each."""

    accelerations: np.ndarray
    inertial: np.ndarray
    coriolis: np.ndarray  # including centrifugal torques
    gravity: np.ndarray


def unusable_efforts(joints: "JointSeries") -> str:
    """Why dynamics cannot be learned from the joint states of a robot; empty if they can be."""
    efforts = joints.values.get("joint_torques")
    if efforts is None:
        return "there are no efforts, or all are NaN"
    if not np.nan_to_num(efforts).any():
        return "all efforts are 0" if np.isfinite(efforts).all() else "all efforts are 0 or NaN"
    if not np.ptp(np.nan_to_num(efforts), axis=0).any():
        return "no effort changes"
    return "" if "joint_velocities" in joints.values else "there are no velocities"


Log = TypeVar("Log", JointLog, DriveLog, PartedLog)


def signals_of(kind: type[MotionLog]) -> list[str]:
    """Names of the (T, n) signals of a kind of log."""
    return [signal.name for signal in fields(kind) if signal.name in UNITS and signal.name != "stamps"]


def write_log_table(logs: Iterable[MotionLog], target: str | Path) -> None:
    """Publish a set of logs as a Parquet table with the columns `stamps`, `positions.JOINT`, ..."""
    write_series(map(_series, logs), UNITS, target)


def _series(log: MotionLog) -> Series:
    columns = {"stamps": log.stamps}
    for signal in signals_of(type(log)):
        columns |= columns_of(signal, getattr(log, signal), log.joints)
    return Series(log.name, columns, {"joints": list(log.joints), "provenance": dict(log.provenance)})


def read_log_table(
    path: str | Path,
    kind: type[Log] = JointLog,  # type: ignore[assignment]  # mypy binds no default to a type variable
) -> list[Log]:
    """Read a set of logs in the order of writing. Raises InputError: it is another kind."""
    logs = []
    for run in each_series(path):
        try:
            joints = tuple(run.about["joints"])
            signals = [run.stacked([f"{signal}.{joint}" for joint in joints]) for signal in signals_of(kind)]
            provenance = run.about["provenance"]
            logs.append(kind(run.name, joints, run.columns["stamps"], *signals, provenance=provenance))
        except KeyError as missing:
            raise InputError(f"{path}: no {kind.__name__}: {run.name} has no {missing}") from missing
    return logs
