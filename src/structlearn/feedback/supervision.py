"""From corrected demonstrations to supervised data: deviations in, coupling targets out (IV.6.2, IV.9.1.3).

Poses come at 300 Hz, electrodes at 100 Hz with clocks of their own; reading a demonstration puts them on one
clock (`recordings.clock`). Everything here is on that clock; the data are thinned to the sensor's rate, since
samples in between would be interpolations that count twice.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from structlearn.feedback.coupling import orientation_target
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.ground.signals import low_pass
from structlearn.primitives import canonical
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sensor_traces import deviation, fit_expected_traces, without_offset
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory, differentiated_orientation
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings.demonstration import Demonstration

Cuts = Mapping[str, pd.DataFrame]
"""Segments by the primitive's name: index demonstration, columns `start_s` and `end_s`."""


class ExpectedTracesParameters(Parameters):
    """Nominal executions in the default setting, and the expected traces learned from them.

    Attributes:
        runs: number of executions.
        level_runs: further ones; nothing is expected from them, but feedback may learn from them that on the
            level board nothing is to be corrected.
        smoothing_hz: low-pass of the traces; about 12 / duration is what 25 kernels resolve.
    """

    runs: int = Field(ge=1, le=1000)
    level_runs: int = Field(ge=0, le=1000)
    smoothing_hz: float = Field(gt=0)


class SupervisionParameters(Parameters):
    """Parameters of the supervised data.

    Attributes:
        primitives: which primitives get a feedback model.
        settings_deg: settings whose corrections are learned from; the others test generalisation.
        axis: (3,) base frame, about which they correct: the roll axis.
        smoothing_hz: low-pass of orientations before they are differentiated twice, about that with which the
            nominal primitive was fitted: what is smoothed more differs from it by a ripple.
        target_hz: low-pass of the coupling target itself, from which the nominal movement has cancelled;
            people correct in submovements of half a second and more, the rest is tremor times tau^2.
        rate_hz: samples per second that are kept.
    """

    primitives: tuple[str, ...] = Field(min_length=1)
    settings_deg: tuple[float, ...] = Field(min_length=1)
    axis: tuple[float, float, float]
    smoothing_hz: float = Field(gt=0)
    target_hz: float = Field(gt=0)
    rate_hz: float = Field(gt=0)

    @model_validator(mode="after")
    def _axis_has_a_direction(self) -> Self:
        if not np.linalg.norm(self.axis) > 0:
            raise ValueError("axis must have a direction")
        return self

    @property
    def unit_axis(self) -> np.ndarray:
        """The axis with norm 1."""
        return np.array(self.axis) / np.linalg.norm(self.axis)


def learn_expected(
    runs: Sequence[Demonstration], cuts: Cuts, smoothing_hz: float
) -> dict[str, VectorPrimitive]:
    """Expected traces of every primitive from nominal executions (associative skill memory).

    Args:
        runs: executions in the default setting.
        cuts: of these runs; those that are not in it are left out.
        smoothing_hz: low-pass of the traces; about 12 / duration is what 25 kernels resolve.

    Returns:
        By primitive, a vector primitive with one dimension per channel.

    Raises:
        InputError: a run has no tactile stream.
    """
    traces = {run.name: without_offset(_tactile(run)) for run in runs}
    return {
        name: fit_expected_traces(
            [_part(traces[run.name], run, table.loc[run.name]) for run in runs if run.name in table.index],
            runs[0].dt,
            smoothing_hz,
        )
        for name, table in cuts.items()
    }


@dataclass(frozen=True)
class CorrectedPrimitive:
    """One primitive in one corrected demonstration.

    Attributes:
        path: (T, 4) corrected orientation, smoothed.
        deviation: (T, D) counts.
        target: (T, 3) coupling term in the base frame.
    """

    path: OrientationTrajectory
    deviation: np.ndarray
    target: np.ndarray


def corrected_primitive(
    demonstration: Demonstration,
    cut: pd.Series,
    primitive: PosePrimitive,
    expected: VectorPrimitive,
    parameters: SupervisionParameters,
) -> CorrectedPrimitive:
    """What one corrected demonstration says about one primitive.

    Args:
        demonstration: complete.
        cut: `start_s` and `end_s` of the primitive in it.
        primitive: the nominal one.
        expected: its expected traces.
        parameters: the low-passes.

    Returns:
        Signals on the demonstration's clock, from the primitive's start to its end.

    Raises:
        InputError: orientation or tactile stream is missing, or the primitive turns beyond half a circle.
    """
    if demonstration.orientation is None or not isinstance(primitive.orientation, QuaternionPrimitive):
        raise InputError(
            f"{demonstration.name}: '{primitive.name}' needs orientations, and a turn of less than half a "
            "circle, to learn a correction"
        )
    dt = demonstration.dt
    whole = differentiated_orientation(demonstration.orientation, dt, parameters.smoothing_hz)
    path = whole.cut(*_ticks(demonstration, cut))
    _, deviating = executed_primitive(demonstration, cut, expected)
    target = low_pass(orientation_target(path, primitive.orientation), dt, parameters.target_hz)
    return CorrectedPrimitive(path, deviating, target)


def executed_primitive(
    run: Demonstration, cut: pd.Series, expected: VectorPrimitive
) -> tuple[np.ndarray, np.ndarray]:
    """Sensor deviations of one primitive in an execution.

    Args:
        run: complete, since the sensors' offset is taken at its start.
        cut: `start_s` and `end_s` of the primitive in it.
        expected: its expected traces.

    Returns:
        (T,) s since the primitive's start, and (T, D) counts.

    Raises:
        InputError: there is no tactile stream, or it has other channels than the expected traces.
    """
    trace = _part(without_offset(_tactile(run)), run, cut)
    if trace.shape[1] != len(expected.start):
        raise InputError(
            f"{run.name}: has {trace.shape[1]} tactile channels, the expected traces have "
            f"{len(expected.start)}"
        )
    return run.dt * np.arange(len(trace)), deviation(expected, trace, run.dt)


def require_parts(
    names: Sequence[str], primitives: Sequence[PosePrimitive], expected: Mapping[str, VectorPrimitive]
) -> None:
    """Check that feedback can be learned for the primitives of these names.

    Raises:
        InputError: there is no such primitive, or nothing is expected of its sensors.
    """
    known = [primitive.name for primitive in primitives]
    for name in names:
        if name not in known:
            raise InputError(
                f"coupling_dataset.primitives: there is no primitive '{name}' among {', '.join(known)}"
            )
        if name not in expected:
            raise InputError(f"no expected traces of '{name}', which feedback is learned from")


def coupling_dataset(
    demonstrations: Mapping[float, Sequence[Demonstration]],
    cuts: Mapping[float, pd.DataFrame],
    primitive: PosePrimitive,
    expected: VectorPrimitive,
    parameters: SupervisionParameters,
) -> tuple[CouplingDataset, pd.DataFrame]:
    """Supervised data of one primitive, and how well they hold together.

    Args:
        demonstrations: corrected ones by setting in degrees.
        cuts: the primitive's segments by setting; demonstrations that are not in it are left out.
        primitive: the nominal one.
        expected: its expected traces.
        parameters: see there.

    Returns:
        The dataset, and one row per demonstration: `setting_deg`, `demonstration`, `name`;
        `reproduction_deg`, largest distance between the demonstration and the primitive unrolled with the
        target about the axis alone; `smoothing_deg`, rms of what the low-pass took away; `others`, rms of
        the target about the other two axes relative to the rms about the axis.
    """
    axis = parameters.unit_axis
    parts, checks = [], []
    for setting, runs in demonstrations.items():
        for number, run in enumerate(runs):
            if run.name not in cuts[setting].index:  # could not be cut, and failures are to be skipped
                continue
            cut = cuts[setting].loc[run.name]
            corrected = corrected_primitive(run, cut, primitive, expected, parameters)
            parts.append(coupling_samples(corrected, setting, number, axis, parameters.rate_hz))
            checks.append(
                {"setting_deg": setting, "demonstration": number, "name": run.name}
                | _checks(corrected, _raw(run, cut), primitive.orientation, axis)
            )
    return concatenated(parts), pd.DataFrame(checks)


def coupling_samples(
    corrected: CorrectedPrimitive, setting: float, number: int, axis: np.ndarray, rate_hz: float
) -> CouplingDataset:
    """What one corrected primitive adds to the supervised data.

    Args:
        corrected: see there.
        setting: in degrees.
        number: of the demonstration within its setting.
        axis: (3,) unit vector about which feedback corrects.
        rate_hz: samples per second that are kept.
    """
    return _samples(
        corrected.path.time, corrected.deviation, corrected.target @ axis, (setting, number), rate_hz
    )


def level_dataset(
    runs: Sequence[Demonstration], cuts: pd.DataFrame, expected: VectorPrimitive, rate_hz: float
) -> CouplingDataset:
    """What executions on the level board add to the data: nothing is to be corrected, c_target = 0.

    Args:
        runs: nominal executions in the default setting.
        cuts: the primitive's segments in them; executions that are not in it are left out.
        expected: the primitive's expected traces.
        rate_hz: samples per second that are kept.
    """
    parts = []
    for number, run in enumerate(runs):
        if run.name in cuts.index:
            time, deviation = executed_primitive(run, cuts.loc[run.name], expected)
            parts.append(_samples(time, deviation, np.zeros(len(time)), (0.0, number), rate_hz))
    return concatenated(parts)


def _samples(
    time: np.ndarray, deviation: np.ndarray, target: np.ndarray, key: tuple[float, int], rate_hz: float
) -> CouplingDataset:
    """Samples of one primitive in one execution; `key` is its setting in degrees and its number there."""
    kept = slice(None, None, max(1, round(1.0 / (rate_hz * (time[1] - time[0])))))
    duration, time = time[-1], time[kept]
    p, u = canonical.phase(time, canonical.time_constant(duration))
    setting, number = key
    return CouplingDataset(
        deviation=deviation[kept],
        phase=p,
        phase_velocity=u,
        target=target[kept],
        setting=np.full(len(time), setting),
        demonstration=np.full(len(time), number),
        time=time,
    )


def _checks(
    corrected: CorrectedPrimitive, raw: np.ndarray, primitive: QuaternionPrimitive, axis: np.ndarray
) -> dict[str, float]:
    path, along = corrected.path, corrected.target @ axis
    again = primitive.unroll(
        path.dt,
        start=path.orientation[0],
        duration=path.duration,
        velocity=path.angular_velocity[0],
        acceleration=path.angular_acceleration[0],
        coupling=lambda k, q, w: along[k] * axis,
    )
    rest = corrected.target - along[:, None] * axis
    smoothing = quaternion.angle_between(path.orientation, raw)
    return {
        "reproduction_deg": float(
            np.degrees(quaternion.angle_between(again.orientation, path.orientation).max())
        ),
        "smoothing_deg": float(np.degrees(np.sqrt(np.mean(smoothing**2)))),
        "others": float(np.sqrt(np.mean(rest**2) * 3 / 2) / max(np.sqrt(np.mean(along**2)), 1e-12)),
    }


def _raw(demonstration: Demonstration, cut: pd.Series) -> np.ndarray:
    return _part(demonstration.orientation, demonstration, cut)


def _ticks(demonstration: Demonstration, cut: pd.Series) -> tuple[int, int]:
    """First and last sample of a primitive."""
    first, last = (round(float(cut[end]) / demonstration.dt) for end in ("start_s", "end_s"))
    return max(first, 0), min(last, len(demonstration.time) - 1)


def _part(signal: np.ndarray, demonstration: Demonstration, cut: pd.Series) -> np.ndarray:
    first, last = _ticks(demonstration, cut)
    return signal[first : last + 1]


def _tactile(demonstration: Demonstration) -> np.ndarray:
    if demonstration.tactile is None:
        raise InputError(f"{demonstration.name}: has no tactile stream, which feedback is learned from")
    return demonstration.tactile
