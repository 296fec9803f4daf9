"""Cut errors, spread of aligned segments, and paired comparison of methods."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.core import metrics, signals
from structlearn.core.metrics import mean_interval, verdict
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.motion_runs import path
from structlearn.segmentation.parameters import Axis, PrimitiveParameters
from structlearn.segmentation.segments import Segmentation

SPREAD_SAMPLES = 200  # points of normalised time at which segments are compared


def cut_errors(demonstrations: Sequence[Demonstration], segmentation: Segmentation) -> pd.DataFrame:
    """Errors of cut points against known true ones, for primitives that have an axis.

    Excluded are primitives between others, which have no cut points of their own, and the reference, which is
    not guessed. `demonstrations`: with `true_segments` in the order of the primitives. Returns
    `demonstration`, `primitive`, `method`, `start_error_s`, `end_error_s` (found minus true).
    """
    true = {run.name: run.true_segments for run in demonstrations if run.true_segments is not None}
    places, cuts = segmentation.primitives, segmentation.cuts
    cuts = cuts[cuts["primitive"].isin(segmentation.pairs["primitive"].unique())]
    cuts = cuts[cuts["demonstration"] != segmentation.reference]
    keys = zip(cuts["demonstration"], cuts["primitive"], strict=True)
    truth = np.array([true[name][places.index(primitive)] for name, primitive in keys])
    return cuts[["demonstration", "primitive", "method"]].assign(
        start_error_s=cuts["start_s"] - truth[:, 0], end_error_s=cuts["end_s"] - truth[:, 1]
    )


def mean_cut_errors_ms(errors: pd.DataFrame) -> pd.DataFrame:
    """Mean and largest absolute cut error in ms by method: columns `mean_ms`, `max_ms`, index `method`."""
    both_ends = errors.melt("method", ["start_error_s", "end_error_s"], value_name="error_s").dropna()
    by_method = (1e3 * both_ends["error_s"].abs()).groupby(both_ends["method"])
    table = pd.DataFrame({"mean_ms": by_method.mean(), "max_ms": by_method.max()})
    return table.reindex([method for method in METHODS if method in table.index])


def aligned_segments(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    primitive: str,
    method: str,
    axis: Axis,
) -> tuple[np.ndarray, list[str]]:
    """Position along an axis of one primitive in all demonstrations, on normalised time.

    Returns (L, SPREAD_SAMPLES, D) m (rad for orientations), and the names of the L demonstrations.
    """
    cuts = segmentation.result(primitive, method)
    curves, names = [], []
    for demonstration in (run for run in demonstrations if run.name in cuts.index):
        start, end = cuts.loc[demonstration.name, ["start_s", "end_s"]].to_numpy(dtype=float)
        times = np.linspace(start, max(end, start), SPREAD_SAMPLES)
        columns = [np.interp(times, demonstration.time, column) for column in path(demonstration, axis).T]
        curves.append(np.column_stack(columns))
        names.append(demonstration.name)
    return np.array(curves), names


def spread_mm(curves: np.ndarray) -> float:
    """Mean distance in mm between pairs of aligned segments (L, T, D), each centred at its mean position.

    Centring removes offsets between demonstrations, which say nothing about the cuts.
    """
    return 1e3 * metrics.pairwise_spread(curves - curves.mean(axis=1, keepdims=True))


def distances_mm(curves: np.ndarray, reference: int) -> np.ndarray:
    """Mean distance (L - 1,) in mm of each aligned segment from the reference's, centred likewise."""
    curves = curves - curves.mean(axis=1, keepdims=True)
    distances = 1e3 * np.linalg.norm(curves - curves[reference], axis=-1).mean(axis=1)
    return np.delete(distances, reference)


def between_dwells(
    demonstration: Demonstration,
    rest_s: tuple[float, float],
    noise_hz: float,
    noise_m: float,
    rng: np.random.Generator,
) -> Demonstration:
    """A single movement embedded between two rests of random length, with known true cut points.

    `rest_s`: range of the rests. Smooth Gaussian noise of std `noise_m` per axis, below `noise_hz`, is added
    to positions; the rests are drawn first, so they do not depend on the noise.
    """
    dt = demonstration.dt
    before, after = (int(s / dt) for s in rng.uniform(*rest_s, 2))
    position = np.pad(demonstration.position, ((before, after), (0, 0)), mode="edge")
    margin = int(np.ceil(4.0 / (noise_hz * dt)))  # removes the filter's transients
    white = rng.standard_normal((len(position) + 2 * margin, 3))
    smooth = signals.low_pass(white, dt, noise_hz)[margin:-margin]
    position = position + noise_m * smooth / smooth.std(axis=0)
    true_segment = dt * np.array([[before, before + len(demonstration.time) - 1]])
    provenance = {**demonstration.provenance, "rests and noise": "added by simulation"}
    time = dt * np.arange(len(position))
    return Demonstration(
        demonstration.name, time, position, true_segments=true_segment, provenance=provenance
    )


BASELINE = "ls"  # method that the text compares weighted least squares with
PERSON = ["noise_mm", "seed", "method"]


def errors_by_seed(noise: pd.DataFrame) -> pd.DataFrame:
    """Mean absolute cut error of every simulated person: `noise_mm`, `seed`, `method`, `error_ms`.

    Averages over demonstrations, primitives and both ends. `noise`: from `cut_sweep.noise_sweep`.
    """
    methods_alone = noise[noise["method"] != "left_out"]
    both_ends = methods_alone[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    return methods_alone.assign(error_ms=1e3 * both_ends).groupby(PERSON, as_index=False)["error_ms"].mean()


def errors_by_level(by_seed: pd.DataFrame) -> pd.DataFrame:
    """Mean and half width of the 95 % confidence interval over the seeds, per noise level and method.

    `by_seed`: from `errors_by_seed`. Returns `noise_mm`, `method`, `mean_ms`, `half_width_ms`.
    """
    rows = [
        (level, method, *mean_interval(errors.to_numpy()))
        for level, at_level in by_seed.groupby("noise_mm")
        for method in METHODS
        if len(errors := at_level.loc[at_level["method"] == method, "error_ms"])
    ]
    return pd.DataFrame(rows, columns=["noise_mm", "method", "mean_ms", "half_width_ms"])


def paired_comparison(by_seed: pd.DataFrame) -> pd.DataFrame:
    """Error of every other method minus that of `RESULT`, paired over the seeds.

    Pairing removes the variation between people, which exceeds that between methods. `by_seed`: from
    `errors_by_seed`. Returns `noise_mm`, `method` (the other), `seeds`, `difference_ms` (positive if `RESULT`
    is better), `low_ms`, `high_ms` (95 % confidence interval) and `verdict` on `RESULT`.
    """
    wide = by_seed.pivot_table(index=["noise_mm", "seed"], columns="method", values="error_ms")
    rows = []
    for other in (method for method in METHODS if method in wide.columns and method != RESULT):
        differences = (wide[other] - wide[RESULT]).dropna()
        for level, at_level in differences.groupby(level="noise_mm"):
            mean, half = mean_interval(at_level.to_numpy())
            rows.append((level, other, len(at_level), mean, mean - half, mean + half))
    columns = ["noise_mm", "method", "seeds", "difference_ms", "low_ms", "high_ms"]
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(verdict=verdict(table["low_ms"], table["high_ms"]))


def wins_at_every_noise_level(by_level: pd.DataFrame) -> bool:
    """Whether `RESULT` has the smallest of `errors_by_level` at every level with noise (and there is one)."""
    means = by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    means = means[means.index > 0]
    wins = means.drop(columns=RESULT).min(axis=1) > means[RESULT]
    return len(wins) > 0 and bool(wins.all())


def alignment_comparison(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    primitives: Sequence[PrimitiveParameters],
) -> pd.DataFrame:
    """How close the refined segments are to each other, and whether closer than by ordinary least squares.

    The spread is a single number for the whole set, so the test uses the distances from the reference's
    segment, paired over the demonstrations (at least one beside the reference). Returns one row per primitive
    and method: `primitive`, `method`, `spread_mm`, `distance_mm` (mean over the demonstrations), `gain_mm`
    (distance by ordinary least squares minus this one; positive if this one is closer), `low_mm`, `high_mm`
    (95 % confidence interval) and `verdict` on this method.
    """
    rows = []
    for primitive in primitives:
        chosen = {
            method: aligned_segments(demonstrations, segmentation, primitive.name, method, primitive.shown_by)
            for method in METHODS
        }
        distances = {
            method: distances_mm(curves, names.index(segmentation.reference))
            for method, (curves, names) in chosen.items()
        }
        for method, by_method in distances.items():
            mean, half = mean_interval(distances[BASELINE] - by_method)
            spread = spread_mm(chosen[method][0])
            rows.append((primitive.name, method, spread, by_method.mean(), mean, mean - half, mean + half))
    columns = ["primitive", "method", "spread_mm", "distance_mm", "gain_mm", "low_mm", "high_mm"]
    table = pd.DataFrame(rows, columns=columns)
    verdicts = np.where(table["method"] == BASELINE, "", verdict(table["low_mm"], table["high_mm"]))
    return table.assign(verdict=verdicts)
