"""Cuts and primitives of a task's recordings, and their distance from what was recorded (IV.5).

A recording is either cut or used whole: as one run of a single primitive, or as one primitive of an execution
that was recorded in parts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

from structlearn.core import metrics, quaternion, signals
from structlearn.core.artefacts import Metrics
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.feedback.coupling import AXES
from structlearn.primitives import stiffness
from structlearn.primitives.fitting import (
    FitParameters,
    RhythmicSegment,
    digital_segments,
    learn_primitive,
    orientations,
    output_segments,
    primitive_errors,
    reproduction_errors,
    segment_paths,
    sequence_segments,
    whole_run_cuts,
    without_frame,
)
from structlearn.primitives.outputs import typical
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive, SequencePath
from structlearn.primitives.twist_swing import largest_turn
from structlearn.primitives.vector import (
    VectorPrimitive,
    expected_traces,
    fit_expected_traces,
    without_offset,
)
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import RESULT, WARNING_COLUMNS
from structlearn.segmentation.cut_errors import between_dwells, cut_errors, mean_cut_errors_ms
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import PAIR_COLUMNS, Segmentation, cut
from structlearn.tasks.movement.parameters import PARTS, RestParameters

NOISE_HZ = 5.0  # cut-off of the noise that is added between simulated rests: a hand trembles no faster
REST_S = (0.3, 1.0)  # range of these rests before and after each movement
SAMPLES = 500  # per path in normalised time


def segmented(
    runs: Sequence[Demonstration], presegmented: str | None, cutting: SegmentParameters | None
) -> Segmentation:
    """Cut recordings, or use them whole if `presegmented`. Raises InputError as `segments.cut`."""
    if presegmented is None:
        assert cutting is not None
        return cut(runs, cutting)
    names = [run.name for run in runs]
    about = {
        "demonstration": names,
        "primitive": names if presegmented == PARTS else presegmented,
        "method": RESULT,
    }
    return Segmentation(
        cuts=pd.DataFrame(about | {"start_s": 0.0, "end_s": [float(run.time[-1]) for run in runs]}),
        pairs=pd.DataFrame(columns=PAIR_COLUMNS),
        left_out=pd.DataFrame(columns=["demonstration", "reason"]),
        warnings=pd.DataFrame(columns=WARNING_COLUMNS).astype({"number": float}),
        reference=runs[0].name,
    )


def learned_cuts(segmentation: Segmentation, keep_flagged: bool) -> dict[str, pd.DataFrame]:
    """Cuts by primitive to learn from: without demonstrations that have a cut warning.

    Raises InputError: all have one.
    """
    flagged = [] if keep_flagged else segmentation.warnings["demonstration"].unique()
    results = {name: cuts[~cuts.index.isin(flagged)] for name, cuts in segmentation.results.items()}
    if not all(len(cuts) for cuts in results.values()):
        reason = segmentation.warnings["reason"].iloc[0]
        raise InputError(
            f"no demonstration is without a cut warning ({reason}); `keep_flagged: true` learns from all"
        )
    return results


def cut_metrics(runs: Sequence[Demonstration], segmentation: Segmentation) -> Metrics:
    """Number of demonstrations, mean durations and, for simulated data, the mean error of the cut points."""
    metrics: Metrics = {
        "cuts_demonstrations": segmentation.cuts["demonstration"].nunique(),
        "cuts_left_out": len(segmentation.left_out),
        "cuts_warnings": len(segmentation.warnings),
    }
    for name, cuts in segmentation.results.items():
        metrics[f"cuts_{name}_mean_s"] = float((cuts["end_s"] - cuts["start_s"]).mean())
    count, true = len(segmentation.primitives), [run.true_segments for run in runs]
    if len(runs) > 1 and all(segments is not None and len(segments) == count for segments in true):
        errors = mean_cut_errors_ms(cut_errors(runs, segmentation))
        metrics["cuts_error_ms"] = float(errors.loc[RESULT, "mean_ms"])
    return metrics


def cut_errors_between_rests(
    runs: Sequence[Demonstration], cutting: SegmentParameters, rests: RestParameters
) -> pd.DataFrame:
    """Cut errors of whole movements that are embedded between random rests with smooth noise.

    The first movement, embedded likewise, is the reference. Rests are the same at every noise level.
    Returns rows of `cut_errors` with `noise_mm` and `seed`.
    """
    work = product(rests.noise_mm, range(rests.seeds))
    find = partial(_found_again, runs=runs, cutting=cutting, rests=rests)
    return pd.concat(parallel_map(find, work, "movements between rests"), ignore_index=True)


def _found_again(
    level: tuple[float, int], runs: Sequence[Demonstration], cutting: SegmentParameters, rests: RestParameters
) -> pd.DataFrame:
    noise, seed = level
    embedded = [
        between_dwells(run, REST_S, NOISE_HZ, 1e-3 * noise, np.random.default_rng([seed, place]))
        for place, run in enumerate(runs)
    ]
    return cut_errors(embedded, cut(embedded, cutting)).assign(noise_mm=noise, seed=seed)


def reproduction(
    runs: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], parameters: FitParameters, fold: int
) -> pd.DataFrame:
    """Distances of primitives from the demonstrations they were learned from and from those left out.

    Returns rows of `cross_validation` with `scaled` (False: forcing terms as published, which do not scale
    with the reach) and `from_mean_mm`, the mean distance of the demonstration from the mean of all, in the
    local frame and normalised time: no single movement can be much closer to all of them. Of joints
    `from_mean_joint`, in their unit.
    """
    factor, unit = (1.0, "joint") if runs[0].of_joints else (1e3, "mm")
    tables, as_published = list[pd.DataFrame](), list[pd.DataFrame]()
    published = parameters.model_copy(update={"scaled_axes": (False,) * 3})
    spread: dict[tuple[str, str], float] = {}
    for name, segments in sequence_segments(runs, cuts, parameters.smoothing_hz).items():
        names = [run.name for run in runs if run.name in cuts[name].index]
        errors = primitive_errors(name, segments, names, parameters, fold)
        tables += [table.assign(scaled=True) for table in errors]
        primitive = learn_primitive(name, segments, published)
        if any(parameters.scaled_axes):
            keys = {"primitive": name, "demonstration": names, "regression": parameters.regression}
            table = reproduction_errors(primitive, segments)
            as_published.append(table.assign(**keys, left_out=False, scaled=False))
        paths = [in_local_frame(position, primitive.position.frame).position for position, _ in segments]
        if primitive.rhythm is not None:  # as many cycles as all have
            cycles = [segment.rhythm.cycles for segment in segments if isinstance(segment, RhythmicSegment)]
            shares = min(cycles) / np.array(cycles)
            paths = [path[: round(share * len(path))] for path, share in zip(paths, shares, strict=True)]
        curves = np.array([signals.time_normalised(path, SAMPLES) for path in paths])
        off = factor * np.linalg.norm(curves - curves.mean(axis=0), axis=2).mean(axis=1)
        spread |= {(name, run): distance for run, distance in zip(names, off, strict=True)}
    table = pd.concat(tables + as_published, ignore_index=True)
    both = zip(table["primitive"], table["demonstration"], strict=True)
    return table.assign(**{f"from_mean_{unit}": [spread[key] for key in both]})


def output_errors(
    runs: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], parameters: FitParameters, fold: int
) -> pd.DataFrame:
    """Distances of each continuous output's primitives from what was recorded, in the output's unit.

    One row per `primitive`, `output` and `left_out`, as in `cross_validation`: `mean` and `max` over the
    demonstrations, and `range`, from the least to the largest value in all.
    """
    rows, as_is = [], without_frame(parameters)
    for place, output in enumerate(runs[0].output_names):
        alone = [replace(run, outputs=run.signal("outputs")[:, [place]]) for run in runs]
        values = np.concatenate([run.signal("outputs") for run in alone])
        for name, segments in output_segments(alone, cuts, parameters.smoothing_hz).items():
            errors = pd.concat(primitive_errors(name, segments, list(cuts[name].index), as_is, fold))
            for left_out, own in errors[errors["regression"] == parameters.regression].groupby("left_out"):
                distances = own["mean_joint"].mean(), own["max_joint"].max(), float(np.ptp(values))
                rows.append((name, output, bool(left_out), *distances))
    return pd.DataFrame(rows, columns=["primitive", "output", "left_out", "mean", "max", "range"])


def edge_times(
    runs: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], primitives: Sequence[PosePrimitive]
) -> pd.DataFrame:
    """Digital outputs of each primitive, and how well the demonstrations agree.

    One row per `primitive` and `output`: whether it `starts_on`; `changes_s`, when it changes in a run of the
    mean duration, in words; `spread_ms`, the mean distance of the demonstrations' edges from these; `alike`
    of `demonstrations` with this state and number of edges.
    """
    rows = []
    for primitive, (name, states) in zip(primitives, digital_segments(runs, cuts).items(), strict=True):
        for place, output in enumerate(runs[0].digital_names):
            first, alike = typical(states, place)
            edges_s = primitive.duration * alike  # (M, E)
            changes_s = np.median(edges_s, axis=0)
            off_ms = 1e3 * float(np.abs(edges_s - changes_s).mean()) if alike.size else 0.0
            words = ", ".join(f"{change_s:.2f}" for change_s in changes_s)
            rows.append((name, output, first, words, off_ms, len(alike), len(states)))
    columns = ["primitive", "output", "starts_on", "changes_s", "spread_ms", "alike", "demonstrations"]
    return pd.DataFrame(rows, columns=columns)


def spreads(
    runs: Sequence[Demonstration],
    cuts: Mapping[str, pd.DataFrame],
    primitives: Sequence[PosePrimitive],
    parameters: FitParameters,
) -> pd.DataFrame:
    """Spread of the demonstrations about each primitive (`stiffness.spread`).

    Returns `primitive` and, along and about the axes of the base, `x`, `y`, `z` (m) and, with orientations,
    `rx`, `ry`, `rz` (rad). Raises InputError as `stiffness.spread`.
    """
    segments = sequence_segments(runs, cuts, parameters.smoothing_hz)
    tables = []
    for primitive in primitives:
        values = stiffness.spread(primitive, segments[primitive.name])
        tables.append(pd.DataFrame(values, columns=AXES[: values.shape[1]]).assign(primitive=primitive.name))
    return pd.concat(tables, ignore_index=True)


def fit_metrics(reproduction: pd.DataFrame, parameters: FitParameters) -> Metrics:
    """Mean distance of each primitive from demonstrations left out, or from its own if there is only one."""
    used = reproduction[(reproduction["regression"] == parameters.regression) & reproduction["scaled"]]
    metrics: Metrics = {}
    for name, errors in used.groupby("primitive", sort=False):
        shown, word = (
            (errors[errors["left_out"]], "left_out") if errors["left_out"].any() else (errors, "fit")
        )
        for unit in ("mm", "deg", "joint"):
            if f"mean_{unit}" in shown:
                metrics[f"primitives_{name}_{word}_{unit}"] = float(shown[f"mean_{unit}"].mean())
    return metrics


def turn_errors(
    runs: Sequence[Demonstration], primitive: PosePrimitive, parameters: FitParameters
) -> pd.DataFrame:
    """Reproduction of orientations by a primitive learned from each run alone, and by the one from all.

    Returns `learned_from`, `compared_with`, `turn_deg` (net rotation of the run), `mean_deg`, `max_deg`,
    `end_deg`. A single run's primitive is unrolled with the run's start, goal and duration, and compared with
    the recorded run; the one from all, with the mean start, goal and duration, and compared with the runs'
    time-normalised mean. Raises InputError: a run has no orientation.
    """
    segments = segment_paths(runs, whole_run_cuts(runs), parameters.smoothing_hz)
    paths, recorded = orientations(segments), [run.signal("orientation") for run in runs]
    turned, rows = [np.degrees(largest_turn([path])) for path in paths], []
    for run, segment, path, turn_deg, reference in zip(runs, segments, paths, turned, recorded, strict=True):
        own = learn_primitive(primitive.name, [segment], parameters).orientation
        assert own is not None
        turn = own.unroll(path.dt, path.orientation[0], path.orientation[-1], path.duration)
        row = {"learned_from": run.name, "compared_with": run.name, "turn_deg": turn_deg}
        rows.append(row | angular_errors(turn.orientation, reference))
    assert primitive.orientation is not None
    turn = primitive.orientation.unroll(paths[0].dt)
    row = {"learned_from": "all", "compared_with": "their mean", "turn_deg": np.mean(turned)}
    rows.append(row | angular_errors(turn.orientation, mean_orientation_path(recorded, len(turn.time))))
    return pd.DataFrame(rows)


def angular_errors(path: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Mean, largest and final angle in degrees between two orientation paths (T, 4)."""
    angle = np.degrees(quaternion.angle_between(path, reference))
    return {"mean_deg": angle.mean(), "max_deg": angle.max(), "end_deg": angle[-1]}


def mean_orientation_path(paths: Sequence[np.ndarray], samples: int) -> np.ndarray:
    """Mean orientation (samples, 4) of paths (T_l, 4) at each fraction of their durations."""
    stretched = np.stack([signals.time_normalised(path, samples) for path in paths], axis=1)
    means = [quaternion.mean(quaternion.normalised(turns)) for turns in stretched]
    return quaternion.sign_continuous(np.array(means))


def execution_errors(parts: Sequence[Demonstration], path: SequencePath) -> pd.DataFrame:
    """Distance of an unrolled sequence from the parts of the execution that it was learned from.

    Returns one row per `primitive`: `mean_mm`, `max_mm`, `end_mm` and, with orientations, `mean_deg`,
    `max_deg`, `end_deg`.
    """
    rows = []
    for part, first, last in zip(parts, path.switches[:-1], path.switches[1:], strict=True):
        here = slice(first, last + 1)
        mm = 1e3 * np.linalg.norm(path.position.position[here] - part.position, axis=1)
        row = {"primitive": part.name, "mean_mm": mm.mean(), "max_mm": mm.max(), "end_mm": mm[-1]}
        if path.orientation is not None:
            row |= angular_errors(path.orientation.orientation[here], part.signal("orientation"))
        rows.append(row)
    return pd.DataFrame(rows)


def learn_traces(
    parts: Sequence[Demonstration], smoothing_hz: float
) -> tuple[dict[str, VectorPrimitive], pd.DataFrame, pd.DataFrame]:
    """Learn sensor primitives of all tactile channels for every part of an execution.

    The sensors' offset is taken at the start of the first part, for the whole execution. Returns sensor
    primitives by part; a table by primitive and electrode with `range` (largest minus smallest count), `rms`
    (rms error in counts) and `nmse`; and the traces, with `primitive`, `electrode`, `time_s`, `recorded`,
    `expected` (counts).
    """
    primitives, scores, traces = {}, [], []
    for part in parts:
        recorded = without_offset(part.signal("tactile"), parts[0].signal("tactile"))
        primitives[part.name] = fit_expected_traces([recorded], part.dt, smoothing_hz)
        expected = expected_traces(primitives[part.name], len(recorded), part.dt)
        about = pd.DataFrame({"primitive": part.name, "electrode": np.arange(1, recorded.shape[1] + 1)})
        errors = {
            "range": np.ptp(recorded, axis=0),
            "rms": np.sqrt(np.mean((expected - recorded) ** 2, axis=0)),
            "nmse": metrics.nmse(expected, recorded),
        }
        scores.append(about.assign(**errors))
        values = {"recorded": recorded.T.ravel(), "expected": expected.T.ravel()}
        each = about.loc[about.index.repeat(len(recorded))]
        traces.append(each.assign(time_s=np.tile(part.time, len(about)), **values))
    return primitives, pd.concat(scores, ignore_index=True), pd.concat(traces, ignore_index=True)
