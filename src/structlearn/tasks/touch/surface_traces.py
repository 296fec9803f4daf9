"""Slides over surfaces, called MATERIAL_NUMBER: expected traces and deviations from them (IV.6)."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from structlearn.core.errors import MissingInputError
from structlearn.primitives.vector import VectorPrimitive, deviation, fit_expected_traces, without_offset
from structlearn.readers import synchronise
from structlearn.readers.clock import held_out_error
from structlearn.readers.demonstration import Demonstration, Recording
from structlearn.tasks.touch.parameters import SurfaceParameters
from structlearn.tasks.touch.touch_names import material_of

# first and last electrode of each part of a BioTac's core (see `tactile.electrodes`)
PLACES = {"side, 1 to 6": (1, 6), "tip, 7 to 10": (7, 10)}
PLACES |= {"side, 11 to 16": (11, 16), "middle, 17 to 19": (17, 19)}


def learn_surfaces(
    recordings: Sequence[Recording], parameters: SurfaceParameters
) -> tuple[VectorPrimitive, dict[str, pd.DataFrame]]:
    """Learn expected traces and score every trial: the traces, and tables by name, see the functions."""
    trials = slides_on_clock(recordings, parameters)
    left_one_out, channels = left_out_deviations(trials, parameters)
    expected, deviations, statistics = deviations_from_expected(trials, parameters)
    return expected, {
        "clock_errors": clock_errors(recordings),
        "deviations": deviations,
        "left_one_out": left_one_out,
        "channels": channels,
        "across_materials": across_materials(trials, parameters),
        "statistics": statistics,
    }


def slides_on_clock(recordings: Sequence[Recording], parameters: SurfaceParameters) -> list[Demonstration]:
    """Trials at the electrodes' rate."""
    return [synchronise(recording, parameters.rate_hz, parameters.max_gap_s) for recording in recordings]


def clock_errors(recordings: Sequence[Recording]) -> pd.DataFrame:
    """Interpolation error of the common clock: every second sample is predicted from its neighbours.

    Gaps are then twice the real ones and noise counts in full, so errors are upper bounds. Returns per kind
    of stream `samples`, `median_gap_ms`, `longest_gap_ms`, and `rms_error`, `max_error` in the signal's unit.
    """
    rows = []
    for stream in (stream for recording in recordings for stream in recording.streams):
        gaps = 1e-6 * np.diff(stream.stamps)
        rows.append((stream.kind, len(stream.stamps), np.median(gaps), gaps.max(), *held_out_error(stream)))
    how = {"samples": "sum", "median_gap_ms": "median", "longest_gap_ms": "max"}
    how |= {"rms_error": "mean", "max_error": "max"}
    return pd.DataFrame(rows, columns=["kind", *how]).groupby("kind", sort=False).agg(how).reset_index()


def deviations_from_expected(
    trials: Sequence[Demonstration], parameters: SurfaceParameters
) -> tuple[VectorPrimitive, pd.DataFrame, pd.DataFrame]:
    """Expected traces from some trials of one material, and deviations of all trials from them.

    Returns the expected traces; `demonstration`, `group` (see `trial_groups`), `rms` and `largest` deviation
    in counts; `mean` and `std` of the deviation over the trials of a group, by `group`, `electrode` and
    `time_s`. Raises MissingInputError if there is no trial to learn from.
    """
    groups = trial_groups([trial.name for trial in trials], parameters)
    traces = {trial.name: without_offset(trial.signal("tactile")) for trial in trials}
    learned = [traces[name] for name, group in groups.items() if group == "learned"]
    if not learned:
        raise MissingInputError("there is no slide to learn from")
    dt = trials[0].dt
    primitive = fit_expected_traces(learned, dt, parameters.smoothing_hz)
    left = {trial.name: deviation(primitive, traces[trial.name], trial.dt) for trial in trials}
    rows = [
        (name, groups[name], np.sqrt(np.mean(values**2)), np.abs(values).max())
        for name, values in left.items()
    ]
    samples = min(len(values) for values in left.values())
    statistics = []
    for group in dict.fromkeys(groups.values()):
        values = np.array([trace[:samples] for name, trace in left.items() if groups[name] == group])
        electrode, sample = np.indices(values.shape[:0:-1]).reshape(2, -1)
        columns = {"group": group, "electrode": electrode + 1, "time_s": dt * sample}
        columns |= {"mean": values.mean(axis=0).T.ravel(), "std": values.std(axis=0).T.ravel()}
        statistics.append(pd.DataFrame(columns))
    deviations = pd.DataFrame(rows, columns=["demonstration", "group", "rms", "largest"])
    return primitive, deviations, pd.concat(statistics, ignore_index=True)


def left_out_deviations(
    trials: Sequence[Demonstration], parameters: SurfaceParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Deviation of every trial from the traces expected from the other trials over the same material.

    Returns per trial `demonstration`, `material`, `rms` in counts, `standard` (see `_standard`) and `nmse`
    over all electrodes (1: as good as their means over the trial); and the same without `standard` by
    `channels` (the material's strong or weak ones, or one of `PLACES`), with the number of `electrodes`.
    """
    whole, parts = [], []
    by_material = _by_material(trials, parameters)
    for material, held_out in _held_out(by_material, trials[0].dt, parameters).items():
        traces = by_material[material]
        ranges = np.median([np.ptp(trace, axis=0) for trace in traces.values()], axis=0)
        electrodes, strong = np.arange(1, len(ranges) + 1), ranges > parameters.strong_counts
        channels = {"strong": strong, "weak": ~strong} | {
            name: (electrodes >= first) & (electrodes <= last) for name, (first, last) in PLACES.items()
        }
        for name, left in held_out.items():
            others = [trace for other, trace in held_out.items() if other != name]
            rms, nmse = _errors(left, traces[name])
            whole.append((name, material, rms, _standard(left, others), nmse))
            parts += [
                (name, material, group, mask.sum(), *_errors(left[:, mask], traces[name][:, mask]))
                for group, mask in channels.items()
                if mask.any()
            ]
    columns = ["demonstration", "material", "rms", "nmse"]
    table = pd.DataFrame(whole, columns=[*columns[:3], "standard", "nmse"])
    return table, pd.DataFrame(parts, columns=[*columns[:2], "channels", "electrodes", *columns[2:]])


def across_materials(trials: Sequence[Demonstration], parameters: SurfaceParameters) -> pd.DataFrame:
    """Errors of each material's expected traces on trials of the other materials.

    Returns `expected` (material), `demonstration` and `material` of the trial, `rms`, `standard` and `nmse`.
    """
    by_material, dt, rows = _by_material(trials, parameters), trials[0].dt, []
    held_out = _held_out(by_material, dt, parameters)
    for expected, learned in by_material.items():
        primitive = fit_expected_traces(list(learned.values()), dt, parameters.smoothing_hz)
        own = list(held_out[expected].values())
        for material in (other for other in by_material if other != expected):
            for name, trace in by_material[material].items():
                left = deviation(primitive, trace, dt)
                rms, nmse = _errors(left, trace)
                rows.append((expected, name, material, rms, _standard(left, own), nmse))
    columns = ["expected", "demonstration", "material", "rms", "standard", "nmse"]
    return pd.DataFrame(rows, columns=columns)


def _held_out(
    by_material: Mapping[str, Mapping[str, np.ndarray]], dt: float, parameters: SurfaceParameters
) -> dict[str, dict[str, np.ndarray]]:
    """Deviations (T, E) of every trial from the traces of the others over its material, if there are any."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for material, traces in by_material.items():
        found[material] = {}
        for name, trace in traces.items():
            if others := [trace for other, trace in traces.items() if other != name]:
                primitive = fit_expected_traces(others, dt, parameters.smoothing_hz)
                found[material][name] = deviation(primitive, trace, dt)
    return found


def _standard(left: np.ndarray, held_out: Sequence[np.ndarray]) -> float:
    """Rms of a deviation (T, E), each electrode relative to its rms over deviations of held-out trials."""
    if not held_out:
        return np.nan
    scale = np.sqrt(np.mean([(trial**2).mean(axis=0) for trial in held_out], axis=0))
    return float(np.sqrt(np.mean((left / scale) ** 2)))


def trial_groups(names: Sequence[str], parameters: SurfaceParameters) -> dict[str, str]:
    """Group of every trial: `learned`, `left out` (sensor fault) or `other material`."""
    sound = Counter(material_of(name) for name in names if name not in parameters.left_out)
    learned = parameters.material
    if sound and learned not in sound:
        learned = sound.most_common(1)[0][0]
    groups = {name: "learned" if material_of(name) == learned else "other material" for name in names}
    return groups | {name: "left out" for name in names if name in parameters.left_out}


def _errors(left: np.ndarray, trace: np.ndarray) -> tuple[float, float]:
    """Rms of a deviation, and its sum of squares divided by that of the trace about the electrodes' means."""
    own = np.sum((trace - trace.mean(axis=0)) ** 2)
    return np.sqrt(np.mean(left**2)), np.sum(left**2) / own


def _by_material(
    trials: Sequence[Demonstration], parameters: SurfaceParameters
) -> dict[str, dict[str, np.ndarray]]:
    """Traces (T, E) by material and trial, without the trials in `left_out`."""
    traces: dict[str, dict[str, np.ndarray]] = {}
    for trial in trials:
        if trial.name not in parameters.left_out:
            traces.setdefault(material_of(trial.name), {})[trial.name] = without_offset(
                trial.signal("tactile")
            )
    return traces
