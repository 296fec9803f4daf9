"""Supervised data from reaches around obstacles: features and coupling targets (IV.8, eq. IV.23).

Everything is in the local frame of the baseline: x along its reach, origin at its start. Starts and ends of
demonstrations vary with the hand's aim, which no obstacle explains, so the coupling target of each is
computed relative to the baseline unrolled from its own start to its own end.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.avoidance.features import NAMES, obstacle_features
from structlearn.avoidance.shapes import Obstacle, check_cloud
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.core.params import Parameters
from structlearn.feedback.coupling import position_target
from structlearn.primitives import canonical
from structlearn.primitives.position import PositionPrimitive, fit_position
from structlearn.primitives.trajectory import Trajectory, differentiated
from structlearn.readers.demonstration import Demonstration

AXES = "xyz"
Samples = TypeVar("Samples")


class AvoidanceDataParameters(Parameters):
    """Preparation of coupling samples from recorded positions."""

    rate_hz: float = Field(ge=25, le=1000)
    smoothing_hz: float = Field(gt=0, le=50)
    keep_every: int = Field(ge=1, le=100)
    cloud_count: int = Field(ge=6, le=10_000)


@dataclass(frozen=True)
class AvoidanceDataset:
    """Samples of demonstrations in several scenarios."""

    # (S, 17) for one obstacle (`obstacle_features`), or (S, F) for a scene (`look_ahead`)
    features: np.ndarray
    target: np.ndarray  # (S, 3) coupling term in the local frame
    phase: np.ndarray  # (S,) p
    phase_velocity: np.ndarray  # (S,) u
    scenario: np.ndarray  # (S,) number of the scenario, from 0
    demonstration: np.ndarray  # (S,) number of the demonstration within the scenario, from 0
    time: np.ndarray  # (S,) s since the start

    def __len__(self) -> int:
        return len(self.time)

    def where(self, mask: np.ndarray) -> Self:
        """Samples selected by a mask (S,) or by indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def fit_baseline(
    demonstrations: Sequence[Demonstration], parameters: AvoidanceDataParameters
) -> PositionPrimitive:
    """Fit the primitive of the free reach, whose local frame is used throughout.

    Raises InputError: the reach is too short to have a direction, or a demonstration too short to
    differentiate.
    """
    primitive = fit_position(
        [smooth_path(demonstration, parameters) for demonstration in demonstrations], frame="reach"
    )
    if primitive.frame == "world":
        length = np.linalg.norm(primitive.goal - primitive.start)
        raise InputError(f"the baseline's reach of {length:g} m is too short to have a direction")
    return primitive


def smooth_path(demonstration: Demonstration, parameters: AvoidanceDataParameters) -> Trajectory:
    """A reach (five samples or more), base frame, resampled finer, smoothed and differentiated twice."""
    from scipy.interpolate import CubicSpline

    if len(demonstration.time) < 5:
        raise InputError(f"{demonstration.name}: {len(demonstration.time)} samples are too few for a reach")
    steps = round((demonstration.time[-1] - demonstration.time[0]) * parameters.rate_hz)
    time = np.linspace(demonstration.time[0], demonstration.time[-1], max(steps, 4) + 1)
    position = CubicSpline(demonstration.time, demonstration.position)(time)
    return differentiated(position, float(time[1] - time[0]), parameters.smoothing_hz)


def to_local(points: np.ndarray, baseline: PositionPrimitive) -> np.ndarray:
    """Points (..., 3) m of the base frame, in the local frame of the baseline, whose origin is its start."""
    return (np.asarray(points, dtype=float) - baseline.start) @ baseline_axes(baseline)


def baseline_axes(baseline: PositionPrimitive) -> np.ndarray:
    """Local frame of the baseline, (3, 3) local to base."""
    return local_frame(baseline.start, baseline.goal, baseline.frame)


def samples(
    demonstration: Demonstration,
    cloud: np.ndarray,
    baseline: PositionPrimitive,
    parameters: AvoidanceDataParameters,
    scenario: int = 0,
    number: int = 0,
) -> AvoidanceDataset:
    """Samples of one demonstration around one obstacle, given by its point cloud (P, 3) m in the base frame.

    Raises InputError: the cloud is empty, or the demonstration too short.
    """
    check_cloud(cloud)
    path = smooth_path(demonstration, parameters).shifted(-baseline.start).turned(baseline_axes(baseline))
    tau = canonical.time_constant(path.duration)
    target = position_target(path, baseline.local, goal=path.position[-1])
    kept = slice(None, None, parameters.keep_every)
    p, u = canonical.phase(path.time[kept], tau)
    local = to_local(cloud, baseline)
    columns = obstacle_features(path.position[kept], path.velocity[kept], tau, local, local.mean(axis=0))
    numbers = np.full(len(p), scenario), np.full(len(p), number)
    return AvoidanceDataset(columns, target[kept], p, u, *numbers, path.time[kept])


def avoidance_dataset(
    sets: Iterable[tuple[Obstacle, Sequence[Demonstration]]],
    baseline: PositionPrimitive,
    parameters: AvoidanceDataParameters,
) -> AvoidanceDataset:
    """Samples of all demonstrations; obstacles (scenarios) and demonstrations are numbered in order.

    Raises InputError: as `samples`, or there are no demonstrations.
    """
    parts = [
        samples(demonstration, obstacle.cloud(parameters.cloud_count), baseline, parameters, place, number)
        for place, (obstacle, demonstrations) in enumerate(sets)
        for number, demonstration in enumerate(demonstrations)
    ]
    if not parts:
        raise InputError("there are no demonstrations past obstacles")
    return concatenated_samples(parts)


def concatenated_samples(parts: Sequence[Samples]) -> Samples:
    """Concatenation of dataclasses of arrays (S, ...)."""
    names = vars(parts[0])
    return type(parts[0])(**{name: np.concatenate([vars(part)[name] for part in parts]) for name in names})


KEYS = ("scenario", "demonstration", "time", "phase", "phase_velocity")
TARGETS = [f"target_{axis}" for axis in AXES]


def avoidance_table(dataset: AvoidanceDataset) -> pd.DataFrame:
    """One row per sample: `KEYS` (the time as `time_s`), `TARGETS` and the named features."""
    columns = {name: getattr(dataset, name) for name in KEYS}
    columns |= dict(zip(TARGETS, dataset.target.T, strict=True))
    columns |= dict(zip(NAMES, dataset.features.T, strict=True))
    return pd.DataFrame(columns).rename(columns={"time": "time_s"})


def avoidance_from_table(table: pd.DataFrame) -> AvoidanceDataset:
    """Dataset from a table of `avoidance_table`."""
    keys = {name: table["time_s" if name == "time" else name].to_numpy() for name in KEYS}
    return AvoidanceDataset(table[list(NAMES)].to_numpy(float), table[TARGETS].to_numpy(float), **keys)
