"""Fit primitives to segmented demonstrations (IV.5.4), and measure how well they reproduce them."""

from collections.abc import Mapping, Sequence
from typing import get_args

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.primitives.kernels import Regression
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive, fit_orientation
from structlearn.primitives.trajectory import (
    OrientationTrajectory,
    Trajectory,
    differentiated,
    differentiated_orientation,
)
from structlearn.readers.demonstration import Demonstration


class FitParameters(Parameters):
    """Parameters of the primitives."""

    smoothing_hz: float = Field(gt=0)
    kernel_count: int = Field(ge=2, le=200)
    regression: Regression
    scaled_axes: tuple[bool, bool, bool]


REPRODUCTION_ERRORS = ("mean_mm", "max_mm", "end_mm", "mean_deg", "max_deg", "end_deg")
"""Columns of reproduction errors; those in degrees exist only with orientations."""

Segment = tuple[Trajectory, OrientationTrajectory | None]
"""Position and, where recorded, orientation of one primitive in one demonstration."""


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
    segments: list[Segment] = []
    for demonstration in (run for run in demonstrations if run.name in cuts.index):
        cut = cuts.loc[demonstration.name]
        first, last = (round(float(cut[end]) / demonstration.dt) for end in ("start_s", "end_s"))
        if last - first < 2:
            raise InputError(f"{demonstration.name}: a segment has fewer than three samples")
        position = differentiated(demonstration.position, demonstration.dt, smoothing_hz)
        orientation = None
        if demonstration.orientation is not None:
            path = differentiated_orientation(demonstration.orientation, demonstration.dt, smoothing_hz)
            orientation = path.cut(first, last)
        segments.append((position.cut(first, last), orientation))
    if len({orientation is None for _, orientation in segments}) > 1:
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
    choice = (parameters.regression, parameters.kernel_count)
    orientation = fit_orientation(orientations(segments), *choice) if any(turns) else None
    return PosePrimitive(name, fit_position(positions, parameters.scaled_axes, *choice), orientation)


def learn_sequence(
    demonstrations: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], parameters: FitParameters
) -> list[PosePrimitive]:
    """Fit all primitives of segmented demonstrations, in order (IV.5.4).

    `cuts`: by primitive in order of time, each as in `segment_paths`.
    """
    return [
        learn_primitive(name, segment_paths(demonstrations, own_cuts, parameters.smoothing_hz), parameters)
        for name, own_cuts in cuts.items()
    ]


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
    tables = []
    for name, own_cuts in cuts.items():
        segments = segment_paths(demonstrations, own_cuts, parameters.smoothing_hz)
        names = [
            demonstration.name for demonstration in demonstrations if demonstration.name in own_cuts.index
        ]
        for regression in get_args(Regression):
            choice = parameters.model_copy(update={"regression": regression})
            errors = {False: reproduction_errors(learn_primitive(name, segments, choice), segments)}
            if len(segments) > 1:
                errors[True] = _left_out(name, segments, choice, min(fold, len(segments) // 2))
            tables += [
                table.assign(primitive=name, demonstration=names, regression=regression, left_out=left_out)
                for left_out, table in errors.items()
            ]
    return pd.concat(tables, ignore_index=True)


def _left_out(name: str, segments: Sequence[Segment], parameters: FitParameters, size: int) -> pd.DataFrame:
    """Errors of segments against primitives learned from all but their fold."""
    errors = []
    for first in range(0, len(segments), size):
        fold = slice(first, first + size)
        others = [*segments[:first], *segments[fold.stop :]]
        errors.append(reproduction_errors(learn_primitive(name, others, parameters), segments[fold]))
    return pd.concat(errors)


def reproduction_errors(primitive: PosePrimitive, segments: Sequence[Segment]) -> pd.DataFrame:
    """Distance of each segment from the primitive, unrolled with the segment's start, goal and duration.

    One row per segment: `mean_mm`, `max_mm`, `end_mm`, `nmse` (all axes together) and, with an orientation,
    `mean_deg`, `max_deg`, `end_deg`.
    """
    rows = []
    for position, orientation in segments:
        path = primitive.position.unroll(
            position.dt, position.position[0], position.position[-1], position.duration
        )
        distance = 1e3 * np.linalg.norm(path.position - position.position, axis=1)
        row = {"mean_mm": distance.mean(), "max_mm": distance.max(), "end_mm": distance[-1]}
        row["nmse"] = _overall_nmse(path.position, position.position)
        if orientation is not None and primitive.orientation is not None:
            turn = primitive.orientation.unroll(
                orientation.dt, orientation.orientation[0], orientation.orientation[-1], orientation.duration
            )
            angle = np.degrees(quaternion.angle_between(turn.orientation, orientation.orientation))
            row |= {"mean_deg": angle.mean(), "max_deg": angle.max(), "end_deg": angle[-1]}
        rows.append(row)
    return pd.DataFrame(rows)


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
    return float(np.sum((prediction - target) ** 2) / np.sum((target - target.mean(axis=0)) ** 2))
