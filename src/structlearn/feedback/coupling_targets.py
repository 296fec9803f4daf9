"""Supervised data from corrected demonstrations: deviations and coupling targets (IV.9.1.3, eq. IV.22).

All signals of a demonstration are on one clock (`readers.clock`): poses are recorded at 300 Hz, electrodes at
100 Hz. The data are thinned to the sensor's rate, since samples in between would be interpolated duplicates.

Of a rhythmic primitive, every demonstration makes its own number of cycles, each of which takes equally long
once time is stretched (`fitting.even_times`); its nominal movement and expected traces make as many.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
import pandas as pd
from pydantic import Field, field_validator

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.core.params import Parameters
from structlearn.core.signals import low_pass
from structlearn.feedback.coupling import AXES, Axis, direction, orientation_target, reach_target, turns
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.primitives import canonical, rhythmic
from structlearn.primitives.fitting import RhythmicSegment, Segment, even_times, rhythm_of
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import (
    OrientationTrajectory,
    PathBase,
    Trajectory,
    differentiated,
    differentiated_orientation,
)
from structlearn.primitives.vector import VectorPrimitive, deviation, fit_expected_traces, without_offset
from structlearn.readers.demonstration import Demonstration

Setting = TypeVar("Setting", float, str)

Cuts = Mapping[str, pd.DataFrame]
"""Segments by primitive: index demonstration, columns `start_s`, `end_s`; `knots` if it is rhythmic."""


class ExpectedTracesParameters(Parameters):
    """Expected sensor traces, learned from nominal executions in the default setting."""

    runs: int = Field(ge=1, le=1000)
    level_runs: int = Field(ge=0, le=1000)
    smoothing_hz: float = Field(gt=0)


WRENCH = "wrench"

Sensor = Literal["tactile", "wrench"]
"""Sensors: counts of all electrodes, or a wrench with force in N and torque in N m."""

WRENCH_CHANNELS = 6


class CorrectionParameters(Parameters):
    """Parameters of the supervised data. Fields: `params.yaml`, `coupling_dataset`."""

    primitives: tuple[str, ...] = Field(min_length=1)
    axes: tuple[Axis, ...] = Field(min_length=1)
    sensors: tuple[Sensor, ...] = Field(min_length=1)
    smoothing_hz: float = Field(gt=0)
    target_hz: float = Field(gt=0)
    rate_hz: float = Field(gt=0)

    @field_validator("axes", "sensors")
    @classmethod
    def _each_once(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(values)) < len(values):
            raise ValueError("holds one of them twice")
        return values


class SupervisionParameters(CorrectionParameters):
    """Corrections on a tilted board; settings not listed here test generalisation."""

    settings_deg: tuple[float, ...] = Field(min_length=1)

    @field_validator("axes")
    @classmethod
    def _one_turn(cls, axes: tuple[Axis, ...]) -> tuple[Axis, ...]:
        if len(axes) != 1 or not turns(axes[0]):
            raise ValueError("the board tilts about one axis: name one of rx, ry, rz")
        return axes

    @property
    def axis(self) -> Axis:
        """The roll axis."""
        return self.axes[0]

    @property
    def unit_axis(self) -> np.ndarray:
        """Direction (3,) of the roll axis."""
        return direction(self.axis)


def learn_expected(
    runs: Sequence[Demonstration], cuts: Cuts, smoothing_hz: float, sensors: Sequence[Sensor]
) -> dict[str, VectorPrimitive]:
    """Expected traces of every primitive, from the nominal executions in its cuts (associative skill memory).

    `smoothing_hz`: low-pass of the traces; 25 kernels resolve about 12 / duration. Returns per primitive a
    vector primitive with one dimension per channel. Raises InputError: a run lacks a sensor's stream.
    """
    traces = {run.name: without_offset(sensor_readings(run, sensors)) for run in runs}
    learned = {}
    for name, table in cuts.items():
        own = [(run, table.loc[run.name]) for run in runs if run.name in table.index]
        parts = [_part(traces[run.name], run, cut) for run, cut in own]
        rhythms = [rhythm for _, cut in own if (rhythm := _rhythm(cut)) is not None]
        learned[name] = fit_expected_traces(parts, runs[0].dt, smoothing_hz, rhythms)
    return learned


@dataclass(frozen=True)
class CorrectedPrimitive:
    """One primitive in one corrected demonstration; a path is None if none of its axes are corrected."""

    nominal: PosePrimitive  # with the demonstration's number of cycles
    time: np.ndarray  # (T,) s since the primitive's start
    point: Trajectory | None  # (T, 3) corrected position, smoothed
    turn: OrientationTrajectory | None  # (T, 4) corrected orientation, smoothed
    deviation: np.ndarray  # (T, D) sensor deviations
    target: np.ndarray  # (T, 6) coupling term on each of `coupling.AXES`; 0 where its path is None
    groups: tuple[int, ...]  # as in `CouplingDataset`


def corrected_primitive(
    demonstration: Demonstration,
    cut: pd.Series,
    primitive: PosePrimitive,
    expected: VectorPrimitive,
    parameters: CorrectionParameters,
) -> CorrectedPrimitive:
    """Supervised data of one primitive in one corrected demonstration, on the demonstration's clock.

    `cut`: `start_s` and `end_s` of the primitive. Raises InputError: the orientation or a sensor's stream is
    missing, or the primitive turns by more than half a circle.
    """
    dt, point, turn = demonstration.dt, None, None
    time, deviating = executed_primitive(demonstration, cut, expected, parameters.sensors)
    target, (position, orientation) = (
        np.zeros((len(time), len(AXES))),
        _smoothed(demonstration, cut, parameters),
    )
    if (rhythm := _rhythm(cut)) is not None:
        primitive = primitive.repeated(rhythm.cycles, first=rhythm.first)
    if not all(map(turns, parameters.axes)):
        point = position
        target[:, :3] = low_pass(reach_target(point, primitive.position), dt, parameters.target_hz)
    if any(map(turns, parameters.axes)):
        if orientation is None or not isinstance(primitive.orientation, QuaternionPrimitive):
            raise InputError(
                f"{demonstration.name}: '{primitive.name}' needs orientations, and a turn of less than half "
                "a circle, to learn a correction"
            )
        turn = orientation
        target[:, 3:] = low_pass(orientation_target(turn, primitive.orientation), dt, parameters.target_hz)
    groups = channel_groups(demonstration, parameters.sensors)
    return CorrectedPrimitive(primitive, time, point, turn, deviating, target, groups)


def executed_primitive(
    run: Demonstration, cut: pd.Series, expected: VectorPrimitive, sensors: Sequence[Sensor]
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) s since the primitive's start and sensor deviations (T, D) of one primitive in a run.

    `run`: the whole run, because the sensors' offset is taken at its start. `cut`: `start_s` and `end_s`.
    Raises InputError: a sensor's stream is missing, or has other channels than the expected traces.
    """
    trace = _part(without_offset(sensor_readings(run, sensors)), run, cut)
    if trace.shape[1] != len(expected.start):
        raise InputError(
            f"{run.name}: has {trace.shape[1]} channels of {' and '.join(sensors)}, the expected traces have "
            f"{len(expected.start)}"
        )
    if (rhythm := _rhythm(cut)) is not None:
        expected = expected.repeated(rhythm.cycles, first=rhythm.first)
    return run.dt * np.arange(len(trace)), deviation(expected, trace, run.dt)


def sensor_readings(run: Demonstration, sensors: Sequence[Sensor]) -> np.ndarray:
    """Sensor readings (T, D) of a run, side by side. Raises InputError: a sensor was not recorded."""
    for sensor in sensors:
        if getattr(run, sensor) is None:
            raise InputError(f"{run.name}: has no {sensor} stream, which feedback is learned from")
    return np.column_stack([getattr(run, sensor) for sensor in sensors])


def channel_groups(run: Demonstration, sensors: Sequence[Sensor]) -> tuple[int, ...]:
    """`CouplingDataset.groups` of a run: counts, N and N m form one group each; empty for a single group."""
    groups = [(3, 3) if sensor == WRENCH else (getattr(run, sensor).shape[1],) for sensor in sensors]
    return sum(groups, ()) if sum(map(len, groups)) > 1 else ()


def sensor_channels(
    sensors: Sequence[Sensor], expected: Mapping[str, VectorPrimitive]
) -> tuple[tuple[str, int], ...]:
    """(sensor, channels), which sum to the channels of the expected traces; empty without traces."""
    if not expected:
        return ()
    total = len(next(iter(expected.values())).start)
    tactile = total - WRENCH_CHANNELS * (WRENCH in sensors)
    return tuple((sensor, WRENCH_CHANNELS if sensor == WRENCH else tactile) for sensor in sensors)


def require_parts(
    names: Sequence[str], primitives: Sequence[PosePrimitive], expected: Mapping[str, VectorPrimitive]
) -> None:
    """Raise InputError if one of the named primitives is unknown or has no expected traces."""
    known = [primitive.name for primitive in primitives]
    for name in names:
        if name not in known:
            raise InputError(
                f"coupling_dataset.primitives: there is no primitive '{name}' among {', '.join(known)}"
            )
        if name not in expected:
            raise InputError(f"no expected traces of '{name}', which feedback is learned from")


def coupling_dataset(
    demonstrations: Mapping[Setting, Sequence[Demonstration]],
    cuts: Mapping[Setting, pd.DataFrame],
    primitive: PosePrimitive,
    expected: VectorPrimitive,
    parameters: CorrectionParameters,
) -> tuple[dict[Axis, CouplingDataset], pd.DataFrame]:
    """Supervised data of one primitive by axis, and consistency checks of each demonstration.

    `demonstrations`: corrected demonstrations by setting, in degrees or by label. `cuts`: the primitive's
    segments by setting; demonstrations without one are left out. Raises InputError: no demonstration could be
    cut, or one lacks a stream.

    Checks are one row per demonstration: `setting` (`setting_deg` if it is a number), `demonstration`,
    `name`; with rotation axes `reproduction_deg`, the largest distance between the demonstration and the
    primitive unrolled with the target on these axes alone, `smoothing_deg`, the RMS of what the low-pass
    removed, and `others`, the RMS of the target about the other axes relative to that about these; with
    position axes likewise `reproduction_m`, `smoothing_m` and `others_position`.
    """
    parts, checks = [], []
    for setting, runs in demonstrations.items():
        for number, run in enumerate(runs):
            if run.name not in cuts[setting].index:  # could not be cut, and failures are skipped
                continue
            cut = cuts[setting].loc[run.name]
            corrected = corrected_primitive(run, cut, primitive, expected, parameters)
            parts.append(coupling_samples(corrected, setting, number, parameters))
            key = "setting" if isinstance(setting, str) else "setting_deg"
            keys = {key: setting, "demonstration": number, "name": run.name}
            checks.append(keys | _checks(corrected, run, cut, parameters.axes))
    if not parts:
        raise InputError(f"'{primitive.name}' was cut in none of the corrected demonstrations")
    datasets = {axis: concatenated([part[axis] for part in parts]) for axis in parameters.axes}
    return datasets, pd.DataFrame(checks)


def coupling_samples(
    corrected: CorrectedPrimitive, setting: float | str, number: int, parameters: CorrectionParameters
) -> dict[Axis, CouplingDataset]:
    """Supervised data of each axis from one corrected primitive; `setting`: in degrees, or a label."""
    readings = corrected.time, corrected.deviation, corrected.groups
    rhythm = corrected.nominal.rhythm
    uncorrected = _samples(*readings, (setting, number), parameters.rate_hz, rhythm)
    targets = corrected.target[thinned(corrected.time, parameters.rate_hz)]
    return {axis: replace(uncorrected, target=targets[:, AXES.index(axis)]) for axis in parameters.axes}


def level_dataset(
    runs: Sequence[Demonstration],
    cuts: pd.DataFrame,
    expected: VectorPrimitive,
    parameters: CorrectionParameters,
    setting: float | str = 0.0,
) -> CouplingDataset:
    """Supervised data of one primitive in the nominal executions in its cuts, with c_target = 0."""
    parts = []
    for number, run in enumerate(runs):
        if run.name in cuts.index:
            cut = cuts.loc[run.name]
            time, deviation = executed_primitive(run, cut, expected, parameters.sensors)
            groups, key = channel_groups(run, parameters.sensors), (setting, number)
            parts.append(_samples(time, deviation, groups, key, parameters.rate_hz, _rhythm(cut)))
    return concatenated(parts)


def thinned(time: np.ndarray, rate_hz: float) -> slice:
    """Slice that thins a clock (T,) to about this rate."""
    return slice(None, None, max(1, round(1.0 / (rate_hz * (time[1] - time[0])))))


def _samples(
    time: np.ndarray,
    deviation: np.ndarray,
    groups: tuple[int, ...],
    key: tuple[float | str, int],
    rate_hz: float,
    rhythm: Rhythm | None,
) -> CouplingDataset:
    """Samples of one primitive in one execution, with c_target = 0; `key`: setting and number."""
    kept = thinned(time, rate_hz)
    duration, time, cycle = time[-1], time[kept], None
    if rhythm is None:
        p, u = canonical.phase(time, canonical.time_constant(duration))
    else:
        elapsed = rhythm.cycles * time / duration
        (p, u), cycle = rhythmic.phase(elapsed, rhythm), rhythm.first + elapsed
    setting, number = (np.full(len(time), value) for value in key)
    target = np.zeros(len(time))
    return CouplingDataset(deviation[kept], p, u, target, setting, number, time, groups, cycle)


def _checks(
    corrected: CorrectedPrimitive,
    run: Demonstration,
    cut: pd.Series,
    axes: Sequence[Axis],
) -> dict[str, float]:
    """Consistency checks of one demonstration, see `coupling_dataset`."""
    primitive = corrected.nominal
    checks, (point, turn), target = {}, (corrected.point, corrected.turn), corrected.target
    chosen = np.isin(AXES, axes)
    kept = np.where(chosen, target, 0.0)
    if turn is not None and primitive.orientation is not None and run.orientation is not None:
        again = _repeated(primitive.orientation, turn, turn.orientation[0], kept[:, 3:])
        distance = quaternion.angle_between(again.orientation, turn.orientation)
        smoothing = quaternion.angle_between(turn.orientation, _part(run.orientation, run, cut))
        checks["reproduction_deg"] = float(np.degrees(distance.max()))
        checks["smoothing_deg"] = float(np.degrees(np.sqrt(np.mean(smoothing**2))))
        checks["others"] = _others(target[:, 3:], chosen[3:])
    if point is not None:
        frame = local_frame(point.position[0], primitive.position.goal, primitive.position.frame)
        moved = _repeated(primitive.position, point, point.position[0], kept[:, :3] @ frame)
        distance = np.linalg.norm(moved.position - point.position, axis=1)
        smoothing = np.linalg.norm(point.position - _part(run.position, run, cut), axis=1)
        checks["reproduction_m"] = float(distance.max())
        checks["smoothing_m"] = float(np.sqrt(np.mean(smoothing**2)))
        checks["others_position"] = _others(target[:, :3], chosen[:3])
    return checks


def _repeated(primitive: Any, path: PathBase, start: np.ndarray, coupling: np.ndarray) -> Any:
    """The primitive unrolled from the initial state of a path, with a coupling term (T, 3) over time."""
    velocity, acceleration = (rate[0] for rate in path.rates)
    return primitive.unroll(
        path.dt, start, None, path.duration, velocity, acceleration, lambda k, x, xd: coupling[k]
    )


def _others(target: np.ndarray, chosen: np.ndarray) -> float:
    """RMS of a target (T, 3) on the axes that are not chosen (3,), relative to that on the chosen ones."""
    if chosen.all():
        return 0.0
    left = np.sqrt(np.mean(np.where(chosen, 0.0, target) ** 2) * 3 / np.sum(~chosen))
    return float(left / max(np.sqrt(np.mean(target[:, chosen] ** 2)), 1e-12))


def _ticks(demonstration: Demonstration, cut: pd.Series) -> tuple[int, int]:
    """First and last sample of a primitive."""
    first, last = (round(float(cut[end]) / demonstration.dt) for end in ("start_s", "end_s"))
    return max(first, 0), min(last, len(demonstration.time) - 1)


def _smoothed(run: Demonstration, cut: pd.Series, parameters: CorrectionParameters) -> Segment:
    """Smoothed position and, where recorded, orientation of one primitive in a run."""
    if "knots" in cut:
        return RhythmicSegment.of(run, cut["knots"], parameters.smoothing_hz)
    ticks, how, turn = _ticks(run, cut), (run.dt, parameters.smoothing_hz), None
    if run.orientation is not None:
        turn = differentiated_orientation(run.orientation, *how).cut(*ticks)
    return differentiated(run.position, *how).cut(*ticks), turn


def _rhythm(cut: pd.Series) -> Rhythm | None:
    """Of strokes; None of a discrete movement."""
    return rhythm_of(cut["knots"]) if "knots" in cut else None


def _part(signal: np.ndarray, demonstration: Demonstration, cut: pd.Series) -> np.ndarray:
    """A primitive's part of a signal (T, D) of a run; of strokes, such that each cycle takes equally long."""
    if "knots" in cut:
        times = even_times(demonstration, cut["knots"])
        return np.stack([np.interp(times, demonstration.time, column) for column in signal.T], axis=1)
    first, last = _ticks(demonstration, cut)
    return signal[first : last + 1]
