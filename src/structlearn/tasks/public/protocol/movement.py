"""Recorded movements: reaches found again between rests, unscrewing beyond half a turn, scraping.

All are learned as primitives of the whole recordings, which hold one movement each.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core import metrics, quaternion, signals
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.primitives import sequence
from structlearn.primitives.fitting import (
    FitParameters,
    Segment,
    learn_primitive,
    orientations,
    reproduction_errors,
    segment_paths,
    whole,
)
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import OrientationPrimitive, PoseGoal, PosePrimitive, SequencePath
from structlearn.primitives.twist_swing import largest_turn
from structlearn.primitives.vector import (
    VectorPrimitive,
    expected_traces,
    fit_expected_traces,
    without_offset,
)
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.cut_errors import Dwells, between_dwells, cut_errors
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut


class ReachParameters(Parameters):
    """Parameters of the reach protocols."""

    segment: SegmentParameters
    fit: FitParameters
    noise_mm: tuple[float, ...] = Field(min_length=1)
    noise_hz: float = Field(gt=0)
    rest_s: tuple[float, float]
    seeds: int = Field(ge=1)
    fold: int = Field(ge=1)


def reach_cut_errors(demonstrations: Sequence[Demonstration], parameters: ReachParameters) -> pd.DataFrame:
    """Errors of the cuts of reaches that were set between random rests with smooth noise.

    The first reach, treated in the same way, is the reference. Rests are the same at every noise level.

    Returns:
        Rows of `cut_errors` with `noise_mm` and `seed`.
    """
    work = [(noise, seed) for noise in parameters.noise_mm for seed in range(parameters.seeds)]
    find = partial(_find_again, demonstrations=demonstrations, parameters=parameters)
    return pd.concat(parallel_map(find, work, "reaches between rests"), ignore_index=True)


def _find_again(
    level: tuple[float, int], demonstrations: Sequence[Demonstration], parameters: ReachParameters
) -> pd.DataFrame:
    noise, seed = level
    dwells = Dwells(*parameters.rest_s, parameters.noise_hz)
    embedded = [
        between_dwells(demonstration, dwells, 1e-3 * noise, np.random.default_rng([seed, place]))
        for place, demonstration in enumerate(demonstrations)
    ]
    errors = cut_errors(embedded, cut(embedded, parameters.segment))
    return errors.assign(noise_mm=noise, seed=seed)


def learn_reaches(
    demonstrations: Sequence[Demonstration], parameters: ReachParameters
) -> tuple[PosePrimitive, pd.DataFrame]:
    """One primitive from all reaches, and its distance from each, also from those that were left out.

    Returns:
        The primitive, and rows of `reproduction_errors` with `demonstration` and `variant`: `learned from`,
        `left out` (of the fold that was not learned from) and `learned from, forcing not scaled`.
    """
    segments = segment_paths(demonstrations, whole(demonstrations), parameters.fit.smoothing_hz)
    names = [demonstration.name for demonstration in demonstrations]
    primitive = learn_primitive("reach", segments, parameters.fit)
    plain = learn_primitive(
        "reach", segments, parameters.fit.model_copy(update={"scaled_axes": (False, False, False)})
    )
    folds, size = [], min(parameters.fold, len(segments) // 2)
    for first in range(0, len(segments), size):
        fold = slice(first, first + size)
        unseen = learn_primitive("reach", [*segments[:first], *segments[fold.stop :]], parameters.fit)
        folds.append(reproduction_errors(unseen, segments[fold]).assign(demonstration=names[fold]))
    errors = {
        "learned from": reproduction_errors(primitive, segments).assign(demonstration=names),
        "left out": pd.concat(folds),
        "learned from, forcing not scaled": reproduction_errors(plain, segments).assign(demonstration=names),
    }
    tables = [table.assign(variant=variant) for variant, table in errors.items()]
    return primitive, pd.concat(tables, ignore_index=True)


def own_spread_mm(segments: Sequence[Segment]) -> float:
    """Mean distance in mm of the demonstrations from their own mean, in local frame and normalised time."""
    curves = [
        signals.time_normalised(in_local_frame(position, "up").position, 500) for position, _ in segments
    ]
    return 1e3 * float(np.linalg.norm(curves - np.mean(curves, axis=0), axis=2).mean())


def learn_unscrewing(
    demonstrations: Sequence[Demonstration], parameters: FitParameters
) -> tuple[PosePrimitive, pd.DataFrame]:
    """A primitive from each log, and one from all of them.

    Returns:
        The joint primitive, and a table with `learned_from`, `compared_with`, `turn_deg` (net turn of the
        log), `mean_deg`, `max_deg`, `end_deg`. A single log's primitive is unrolled with the log's start,
        goal and duration and compared with the log as recorded; the joint one with the mean start, goal and
        duration and compared with the logs' time-normalised mean.
    """
    segments = segment_paths(demonstrations, whole(demonstrations), parameters.smoothing_hz)
    rows = []
    paths = orientations(segments)
    for demonstration, segment, path in zip(demonstrations, segments, paths, strict=True):
        primitive = turning(learn_primitive("unscrew", [segment], parameters))
        turn = primitive.unroll(path.dt, path.orientation[0], path.orientation[-1], path.duration)
        rows.append(
            {
                "learned_from": demonstration.name,
                "compared_with": demonstration.name,
                "turn_deg": np.degrees(largest_turn([path])),
                **angular_errors(turn.orientation, demonstration.signal("orientation")),
            }
        )
    joint = learn_primitive("unscrew", segments, parameters)
    turn = turning(joint).unroll(paths[0].dt)
    mean = mean_orientation_path(
        [demonstration.signal("orientation") for demonstration in demonstrations], len(turn.time)
    )
    turns = np.degrees([largest_turn([path]) for path in paths])
    rows.append(
        {
            "learned_from": "all",
            "compared_with": "their mean",
            "turn_deg": turns.mean(),
            **angular_errors(turn.orientation, mean),
        }
    )
    return joint, pd.DataFrame(rows)


def turning(primitive: PosePrimitive) -> OrientationPrimitive:
    """How a primitive turns the hand.

    Raises:
        InputError: it was learned without orientations.
    """
    if primitive.orientation is None:
        raise InputError(f"{primitive.name}: was learned without orientations")
    return primitive.orientation


def angular_errors(path: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Mean, largest and final angle in degrees between two orientation paths (T, 4)."""
    angle = np.degrees(quaternion.angle_between(path, reference))
    return {"mean_deg": angle.mean(), "max_deg": angle.max(), "end_deg": angle[-1]}


def mean_orientation_path(paths: Sequence[np.ndarray], samples: int) -> np.ndarray:
    """Time-normalised mean of orientation paths.

    Returns:
        (samples, 4) the mean orientation at each fraction of the duration.
    """
    stretched = np.array([signals.time_normalised(path, samples) for path in paths])
    return quaternion.sign_continuous(
        np.array([quaternion.mean(quaternion.normalised(stretched[:, k])) for k in range(samples)])
    )


class ExecutionParameters(Parameters):
    """Learning from the recorded execution."""

    fit: FitParameters
    tactile_smoothing_hz: float = Field(gt=0)


def learn_execution(
    parts: Sequence[Demonstration], parameters: FitParameters
) -> tuple[list[PosePrimitive], SequencePath, pd.DataFrame]:
    """Primitives of the execution, unrolled as a sequence with goal evolution.

    Returns:
        The primitives, the unrolled sequence, and per primitive the distance from the recording: `mean_mm`,
        `max_mm`, `end_mm`, and with orientations `mean_deg`, `max_deg`, `end_deg`.
    """
    segments = [segment_paths([part], whole([part]), parameters.smoothing_hz)[0] for part in parts]
    primitives = [
        learn_primitive(part.name, [segment], parameters)
        for part, segment in zip(parts, segments, strict=True)
    ]
    goals = [
        PoseGoal(position.position[-1], None if orientation is None else orientation.orientation[-1])
        for position, orientation in segments
    ]
    path = sequence.unroll(primitives, parts[0].dt, goals=goals)
    rows = []
    for part, first, last in zip(parts, path.switches[:-1], path.switches[1:], strict=True):
        here = slice(first, last + 1)
        distance = 1e3 * np.linalg.norm(path.position.position[here] - part.position, axis=1)
        row = {
            "primitive": part.name,
            "mean_mm": distance.mean(),
            "max_mm": distance.max(),
            "end_mm": distance[-1],
        }
        if path.orientation is not None:
            turned, recorded = path.orientation.orientation[here], part.signal("orientation")
            row |= angular_errors(turned, recorded)
        rows.append(row)
    return primitives, path, pd.DataFrame(rows)


def learn_traces(
    parts: Sequence[Demonstration], parameters: ExecutionParameters
) -> tuple[list[VectorPrimitive], pd.DataFrame, pd.DataFrame]:
    """Sensor primitives of all electrodes in every primitive.

    The sensors' offset is taken at the start of the first primitive and stays for the whole run.

    Returns:
        One vector primitive per recorded primitive; a table per primitive and electrode with `range` (largest
        minus smallest count), `rms` (root mean squared error in counts) and `nmse`; and the traces, with
        `primitive`, `electrode`, `time_s`, `recorded`, `expected` (counts).
    """
    primitives, scores, traces = [], [], []
    for part in parts:
        recorded = without_offset(part.signal("tactile"), parts[0].tactile)
        primitive = fit_expected_traces([recorded], part.dt, parameters.tactile_smoothing_hz)
        unrolled = expected_traces(primitive, len(recorded), part.dt)
        primitives.append(primitive)
        electrodes = np.arange(1, recorded.shape[1] + 1)
        scores.append(
            pd.DataFrame(
                {
                    "primitive": part.name,
                    "electrode": electrodes,
                    "range": np.ptp(recorded, axis=0),
                    "rms": np.sqrt(np.mean((unrolled - recorded) ** 2, axis=0)),
                    "nmse": metrics.nmse(unrolled, recorded),
                }
            )
        )
        traces.append(
            pd.DataFrame(
                {
                    "primitive": part.name,
                    "electrode": np.repeat(electrodes, len(recorded)),
                    "time_s": np.tile(part.time, len(electrodes)),
                    "recorded": recorded.T.ravel(),
                    "expected": unrolled.T.ravel(),
                }
            )
        )
    return primitives, pd.concat(scores, ignore_index=True), pd.concat(traces, ignore_index=True)
