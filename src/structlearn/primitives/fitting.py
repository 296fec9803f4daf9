"""Fit primitives to segmented demonstrations (IV.5.4), and measure how well they reproduce them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress
from typing import Self, get_args

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.primitives import canonical
from structlearn.primitives.kernels import Regression
from structlearn.primitives.orientation import QuaternionPrimitive, fit_rhythmic_quaternion
from structlearn.primitives.outputs import Switching, hysteresis, switched, typical
from structlearn.primitives.position import (
    FrameChoice,
    fit_position,
    fit_position_subsets,
    fit_rhythmic_position,
)
from structlearn.primitives.rhythmic import PARTS, Rhythm, amplitude
from structlearn.primitives.sequence import PosePrimitive, fit_orientation, fit_orientation_subsets
from structlearn.primitives.trajectory import (
    OrientationTrajectory,
    Trajectory,
    differentiated,
    differentiated_orientation,
)
from structlearn.primitives.vector import SubsetFit, rhythmic_target
from structlearn.readers.demonstration import Demonstration


class FitParameters(Parameters):
    """Parameters of the primitives."""

    smoothing_hz: float = Field(gt=0)
    kernel_count: int = Field(ge=2, le=200)
    regression: Regression
    scaled_axes: tuple[bool, bool, bool]

    @property
    def frame_choice(self) -> FrameChoice:
        """Frame in which positions are learned: along the reach, as published (IV.6.1)."""
        return "reach"


MARGIN_TICKS = 200  # of recorded time around strokes, with which they are filtered

REPRODUCTION_ERRORS = (
    *("mean_mm", "max_mm", "end_mm", "mean_deg", "max_deg", "end_deg"),
    *("mean_joint", "max_joint", "end_joint"),
)
"""Columns of reproduction errors; those in degrees exist only with orientations. Joints have their own, in
the unit of the joints."""

Segment = tuple[Trajectory, OrientationTrajectory | None]
"""Position and, where recorded, orientation of one primitive in one demonstration."""


class RhythmicSegment(Segment):
    """Segment of a rhythmic primitive, in even time: each of its cycles takes equally long."""

    rhythm: Rhythm

    @classmethod
    def of(cls, run: Demonstration, knots: np.ndarray, smoothing_hz: float) -> Self:
        """Strokes of a run; `knots`: (K, 2) s and cycles, between which time is stretched smoothly."""
        dt, rhythm = run.dt, rhythm_of(knots)
        ticks = round(float(np.ptp(knots[:, 0])) / dt)
        margin = min(round(ticks / rhythm.cycles), MARGIN_TICKS)
        times = even_times(run, knots, margin)
        columns = [np.interp(times, run.time, column) for column in run.position.T]
        ends, orientation = (margin, margin + ticks), None
        if run.orientation is not None:
            turned = quaternion.interpolate(times, run.time, run.orientation)
            orientation = differentiated_orientation(turned, dt, smoothing_hz).cut(*ends)
        position = differentiated(np.stack(columns, axis=1), dt, smoothing_hz).cut(*ends)
        strokes = cls((position, orientation))
        strokes.rhythm = rhythm
        return strokes

    def repeated_by(self, primitive: PosePrimitive) -> PosePrimitive:
        """The primitive with the number of cycles and the amplitude of this demonstration."""
        local, orientation = primitive.position.local, primitive.orientation
        own = replace(local, rhythm=self.rhythm, weights=self.amplitude(primitive) * local.weights)
        if isinstance(orientation, QuaternionPrimitive):
            orientation = replace(orientation, rhythm=self.rhythm)
        position = replace(primitive.position, local=own)
        return replace(primitive, position=position, orientation=orientation)

    def amplitude(self, primitive: PosePrimitive) -> float:
        """Amplitude relative to the primitive; negative if the strokes go the other way."""
        weights = primitive.position.local.weights
        return amplitude(weights, *rhythmic_target(self[0], self.rhythm, len(weights) // PARTS))


def rhythm_of(knots: np.ndarray) -> Rhythm:
    """Rhythm of a run of strokes with knots (K, 2) s and cycles."""
    first, last = knots[[0, -1], 1].tolist()
    return Rhythm(first, last - first)


def even_times(run: Demonstration, knots: np.ndarray, margin: int = 0) -> np.ndarray:
    """Times (T,) s in a run at which its strokes have gone equal shares of a cycle, one for each tick.

    `knots`: (K, 2) s and cycles. `margin`: ticks before and after.
    """
    from scipy.interpolate import PchipInterpolator  # takes a third of a second to import

    (start, first), (end, last) = knots[[0, -1]]
    period = (end - start) / (last - first)
    outside = np.array([[start - period, first - 1.0], *knots, [end + period, last + 1.0]])
    ticks = round((end - start) / run.dt)
    even = first + np.arange(-margin, ticks + margin + 1) * ((last - first) / ticks)
    return np.clip(PchipInterpolator(*outside.T[::-1])(even), 0.0, run.time[-1])


def in_phase(
    runs: Sequence[Demonstration], cuts: pd.DataFrame, primitive: PosePrimitive, smoothing_hz: float
) -> pd.DataFrame:
    """Cuts of a primitive in some runs, their cycles counted as the primitive's.

    Runs that are cut on their own count from where their reference begins, which may be the other side.
    """
    if primitive.rhythm is None:
        return cuts
    knots = {}
    for run in runs:
        if run.name in cuts.index:
            own = cuts.loc[run.name, "knots"]
            opposite = RhythmicSegment.of(run, own, smoothing_hz).amplitude(primitive) < 0.0
            knots[run.name] = own + np.array([0.0, 0.5 * opposite])
    return cuts.assign(knots=pd.Series(knots))


def whole_run_cuts(demonstrations: Sequence[Demonstration]) -> pd.DataFrame:
    """Cuts of demonstrations that are a single primitive from start to end: index demonstration."""
    ends = [(0.0, float(demonstration.time[-1])) for demonstration in demonstrations]
    names = pd.Index([demonstration.name for demonstration in demonstrations], name="demonstration")
    return pd.DataFrame(ends, columns=["start_s", "end_s"], index=names)


def segment_paths(
    demonstrations: Sequence[Demonstration], cuts: pd.DataFrame, smoothing_hz: float
) -> list[Segment]:
    """One primitive's segment of every demonstration in the cuts; demonstrations are smoothed before cutting.

    `cuts`: index demonstration, columns `start_s`, `end_s`. Raises InputError: a segment has fewer than three
    samples, or some demonstrations have no orientation.
    """
    return sequence_segments(demonstrations, {"": cuts}, smoothing_hz)[""]


def sequence_segments(
    demonstrations: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], smoothing_hz: float
) -> dict[str, list[Segment]]:
    """Segments of several primitives as in `segment_paths`; each demonstration is smoothed only once."""
    segments: dict[str, list[Segment]] = {name: [] for name in cuts}
    for demonstration in demonstrations:
        own = {
            name: rows.loc[demonstration.name]
            for name, rows in cuts.items()
            if demonstration.name in rows.index
        }
        if not own:
            continue
        dt = demonstration.dt
        position, orientation = differentiated(demonstration.position, dt, smoothing_hz), None
        if demonstration.orientation is not None:
            orientation = differentiated_orientation(demonstration.orientation, dt, smoothing_hz)
        for name, cut in own.items():
            ends = [round(float(cut[end]) / dt) for end in ("start_s", "end_s")]
            if ends[1] - ends[0] < 2:
                raise InputError(f"{demonstration.name}: a segment has fewer than three samples")
            if "knots" in cut:
                segments[name].append(RhythmicSegment.of(demonstration, cut["knots"], smoothing_hz))
                continue
            segments[name].append(
                (position.cut(*ends), None if orientation is None else orientation.cut(*ends))
            )
    for of_primitive in segments.values():
        if len({orientation is None for _, orientation in of_primitive}) > 1:
            raise InputError("some demonstrations have an orientation and some have none")
    return segments


def orientations(segments: Sequence[Segment]) -> list[OrientationTrajectory]:
    """Orientations of segments. Raises InputError: a segment has none."""
    turns = [orientation for _, orientation in segments if orientation is not None]
    if len(turns) < len(segments):
        raise InputError("a segment has no orientation")
    return turns


def learn_primitive(name: str, segments: Sequence[Segment], parameters: FitParameters) -> PosePrimitive:
    """Fit one primitive to its segments, one per demonstration; with orientation if it was recorded."""
    positions, turns = zip(*segments, strict=True)
    rhythms = [segment.rhythm for segment in segments if isinstance(segment, RhythmicSegment)]
    if rhythms:
        count = parameters.kernel_count
        turning = fit_rhythmic_quaternion(orientations(segments), rhythms, count) if any(turns) else None
        point = fit_rhythmic_position(positions, rhythms, count, parameters.frame_choice)
        return PosePrimitive(name, point, turning)
    choice = (parameters.regression, parameters.kernel_count)
    orientation = fit_orientation(orientations(segments), *choice) if any(turns) else None
    position = fit_position(positions, parameters.scaled_axes, *choice, parameters.frame_choice)
    return PosePrimitive(name, position, orientation)


def learn_sequence(
    demonstrations: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], parameters: FitParameters
) -> list[PosePrimitive]:
    """Fit all primitives of segmented demonstrations, in order (IV.5.4).

    `cuts`: by primitive in order of time, each as in `segment_paths`.
    """
    segments = sequence_segments(demonstrations, cuts, parameters.smoothing_hz)
    learned = [learn_primitive(name, of_primitive, parameters) for name, of_primitive in segments.items()]
    if demonstrations[0].outputs is not None:
        beside = output_segments(demonstrations, cuts, parameters.smoothing_hz)
        as_is = without_frame(parameters)
        for place, (name, of_primitive) in enumerate(beside.items()):
            outputs = learn_primitive(name, of_primitive, as_is).position
            learned[place] = replace(learned[place], outputs=outputs)
    if demonstrations[0].digital is not None:
        for place, states in enumerate(digital_segments(demonstrations, cuts).values()):
            steady = learned[place].rhythm is not None  # the number of strokes varies, so no edge has a phase
            learned[place] = replace(learned[place], switching=learn_switching(states, steady))
    return learned


def without_frame(parameters: FitParameters) -> FitParameters:
    """The same for coordinates that are no point's: joints, outputs."""
    return _WithoutFrame(**parameters.model_dump(include=set(FitParameters.model_fields)))


class _WithoutFrame(FitParameters):
    @property
    def frame_choice(self) -> FrameChoice:
        return "none"


def output_segments(
    demonstrations: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], smoothing_hz: float
) -> dict[str, list[Segment]]:
    """As `sequence_segments`, of the continuous outputs in place of the position.

    Raises InputError: a demonstration has none.
    """
    beside = [replace(run, position=run.signal("outputs"), orientation=None) for run in demonstrations]
    return sequence_segments(beside, cuts, smoothing_hz)


def digital_segments(
    demonstrations: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame]
) -> dict[str, list[np.ndarray]]:
    """States (T_l, B) of the digital outputs in each primitive's segments.

    Raises InputError: a demonstration has none.
    """
    low, high = hysteresis([run.signal("digital") for run in demonstrations])
    states = {run.name: (run.dt, switched(run.signal("digital"), low, high)) for run in demonstrations}
    return {
        name: [
            on[round(start / dt) : round(end / dt) + 1]
            for (dt, on), start, end in zip(
                (states[str(run)] for run in rows.index), rows["start_s"], rows["end_s"], strict=True
            )
        ]
        for name, rows in cuts.items()
    }


def learn_switching(states: Sequence[np.ndarray], steady: bool = False) -> Switching:
    """Switching of a primitive from states (T_l, B); `steady`: as they are for most of the time."""
    if steady:
        return Switching(np.mean([own.mean(axis=0) for own in states], axis=0) > 0.5, np.empty((0, 2)))
    firsts, alike = zip(*(typical(states, output) for output in range(states[0].shape[1])), strict=True)
    pairs = [(output, share) for output, own in enumerate(alike) for share in np.median(own, axis=0)]
    edges = np.array(pairs, dtype=float).reshape(-1, 2)
    edges[:, 1] = canonical.phase(edges[:, 1], canonical.TAU_PER_DURATION)[0]
    return Switching(np.array(firsts), edges)


def cross_validation(
    demonstrations: Sequence[Demonstration],
    cuts: Mapping[str, pd.DataFrame],
    parameters: FitParameters,
    fold: int = 1,
) -> pd.DataFrame:
    """Reproduction errors on training demonstrations and on left-out ones, for both regressions.

    `cuts`: as in `learn_sequence`. `fold`: number of consecutive demonstrations left out together, at most
    half of them. Returns rows of `reproduction_errors` with `primitive`, `demonstration`, `regression` and
    `left_out`: False if the primitive was learned from all demonstrations, True if without this fold.
    """
    segments = sequence_segments(demonstrations, cuts, parameters.smoothing_hz)
    tables = []
    for name, of_primitive in segments.items():
        names = [run.name for run in demonstrations if run.name in cuts[name].index]
        tables += primitive_errors(name, of_primitive, names, parameters, fold)
    return pd.concat(tables, ignore_index=True)


def primitive_errors(
    name: str,
    segments: Sequence[Segment],
    demonstrations: Sequence[str],
    parameters: FitParameters,
    fold: int,
) -> list[pd.DataFrame]:
    """Rows of `cross_validation` for one primitive, from its segments and their demonstrations' names."""
    learned = {
        method: learn_primitive(name, segments, parameters.model_copy(update={"regression": method}))
        for method in get_args(Regression)
    }
    size = min(fold, len(segments) // 2) or 1
    without = learn_subsets(name, segments, parameters) if len(segments) > 1 else None
    places = np.arange(len(segments))
    rows: dict[tuple[Regression, bool], list[dict[str, float]]] = {}
    for first in places[::size]:  # a fold after the other, since its primitives share features
        used = (places < first) | (places >= first + size)
        for method, of_all in learned.items():
            primitives = {False: of_all} if without is None else {False: of_all, True: without(used, method)}
            for left_out, primitive in primitives.items():
                errors = [_errors(primitive, segments[place]) for place in places[~used].tolist()]
                rows.setdefault((method, left_out), []).extend(errors)
    keys = {"primitive": name, "demonstration": list(demonstrations)}
    return [
        pd.DataFrame(errors).assign(**keys, regression=method, left_out=left_out)
        for (method, left_out), errors in rows.items()
    ]


def learn_subsets(
    name: str, segments: Sequence[Segment], parameters: FitParameters
) -> SubsetFit[PosePrimitive]:
    """As `learn_primitive`, from some of the segments at a time, by either regression."""
    if isinstance(segments[0], RhythmicSegment):  # has one regression
        return lambda used, _: learn_primitive(name, list(compress(segments, used)), parameters)
    positions, turns = zip(*segments, strict=True)
    count = parameters.kernel_count
    position = fit_position_subsets(positions, parameters.scaled_axes, count, parameters.frame_choice)
    orientation = fit_orientation_subsets(orientations(segments), count) if any(turns) else None

    def fit(used: np.ndarray, method: Regression) -> PosePrimitive:
        return PosePrimitive(
            name, position(used, method), None if orientation is None else orientation(used, method)
        )

    return fit


def reproduction_errors(primitive: PosePrimitive, segments: Sequence[Segment]) -> pd.DataFrame:
    """Distance of each segment from the primitive, unrolled with the segment's start, goal and duration.

    Rhythmic ones also have its number of cycles and amplitude, and are compared at the same phase.

    One row per segment: `mean_mm`, `max_mm`, `end_mm`, `nmse` (all axes together) and, with an orientation,
    `mean_deg`, `max_deg`, `end_deg`; without a frame `mean_joint`, `max_joint`, `end_joint`.
    """
    return pd.DataFrame([_errors(primitive, segment) for segment in segments])


def unrolled(primitive: PosePrimitive, segment: Segment) -> tuple[Trajectory, OrientationTrajectory | None]:
    """The primitive with the start, goal and duration of a segment; a rhythmic one also with its cycles."""
    position, orientation = segment
    if isinstance(segment, RhythmicSegment):
        primitive = segment.repeated_by(primitive)
    path = primitive.position.unroll(
        position.dt, position.position[0], position.position[-1], position.duration
    )
    if orientation is None or primitive.orientation is None:
        return path, None
    ends = orientation.orientation[0], orientation.orientation[-1]
    return path, primitive.orientation.unroll(orientation.dt, *ends, orientation.duration)


def _errors(primitive: PosePrimitive, segment: Segment) -> dict[str, float]:
    """Row of `reproduction_errors`."""
    position, orientation = segment
    path, turn = unrolled(primitive, segment)
    factor, unit = (1.0, "joint") if primitive.position.frame == "none" else (1e3, "mm")
    distance = factor * np.linalg.norm(path.position - position.position, axis=1)
    row = {f"mean_{unit}": distance.mean(), f"max_{unit}": distance.max(), f"end_{unit}": distance[-1]}
    row["nmse"] = _overall_nmse(path.position, position.position)
    if orientation is not None and turn is not None:
        angle = np.degrees(quaternion.angle_between(turn.orientation, orientation.orientation))
        row |= {"mean_deg": angle.mean(), "max_deg": angle.max(), "end_deg": angle[-1]}
    return row


def reproduction_summary(errors: pd.DataFrame) -> pd.DataFrame:
    """Errors of `cross_validation` over all demonstrations: means of mean errors, maxima of the others.

    One row per `primitive` (in order of time), `regression` and `left_out`, with the columns of
    `REPRODUCTION_ERRORS` that are present.
    """
    known = [column for column in REPRODUCTION_ERRORS if column in errors.columns]
    how = {column: "mean" if column.startswith("mean") else "max" for column in known}
    keys = ["primitive", "regression", "left_out"]
    overall = errors.groupby(keys, as_index=False, sort=False).agg(how)

    def in_first_order(column: pd.Series) -> pd.Series:
        return pd.Series(pd.factorize(column)[0], index=column.index)

    return overall.sort_values(keys, key=in_first_order, kind="stable", ignore_index=True)


def _overall_nmse(prediction: np.ndarray, target: np.ndarray) -> float:
    """NMSE over all axes together, (T, D) each: axes without motion cause no division by zero."""
    spread = np.sum((target - target.mean(axis=0)) ** 2)
    return float(np.sum((prediction - target) ** 2) / max(spread, np.finfo(float).tiny))
