"""Recorded slides of a tactile finger: expected traces of one material, deviations on another."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import MissingInputError
from structlearn.core.params import Parameters
from structlearn.primitives.vector import VectorPrimitive, deviation, fit_expected_traces, without_offset
from structlearn.readers.clock import held_out_error
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.recording import Recording
from structlearn.readers.slide import material_of

GROUPS = ("left out", "other material", "learned")
"""Groups of trials, the most telling first."""

PLACES = {
    "side, 1 to 6": (1, 6),
    "tip, 7 to 10": (7, 10),
    "side, 11 to 16": (11, 16),
    "middle, 17 to 19": (17, 19),
}
"""First and last electrode of each part of a BioTac's core (see `tactile.electrodes`)."""


class SlideParameters(Parameters):
    """Parameters of the slides."""

    rate_hz: float = Field(gt=0)
    max_gap_s: float = Field(gt=0)
    material: str
    left_out: tuple[str, ...]
    strong_counts: float = Field(gt=0)
    smoothing_hz: float = Field(gt=0)


def clock_errors(recordings: Sequence[Recording]) -> pd.DataFrame:
    """What it costs to put the streams on one clock: error of interpolation, measured on held-out samples.

    Returns:
        Per kind of stream: `samples`, `median_gap_ms`, `longest_gap_ms`, and `rms_error`, `max_error` (in the
        unit of the signal) of every second sample predicted from its neighbours. The gaps bridged here are
        twice the real ones, so these are upper bounds; noise of the sensor counts in full.
    """
    rows = []
    for recording in recordings:
        for stream in recording.streams:
            gaps = 1e-6 * np.diff(stream.stamps)
            rms, largest = held_out_error(stream)
            rows.append(
                {
                    "kind": stream.kind,
                    "samples": len(stream.stamps),
                    "median_gap_ms": np.median(gaps),
                    "longest_gap_ms": gaps.max(),
                    "rms_error": rms,
                    "max_error": largest,
                }
            )
    table = pd.DataFrame(rows).groupby("kind", sort=False)
    return table.agg(
        {
            "samples": "sum",
            "median_gap_ms": "median",
            "longest_gap_ms": "max",
            "rms_error": "mean",
            "max_error": "max",
        }
    ).reset_index()


def learn_slides(
    demonstrations: Sequence[Demonstration], parameters: SlideParameters
) -> tuple[VectorPrimitive, pd.DataFrame, pd.DataFrame]:
    """Expected traces from some trials of one material, and how all trials deviate from them.

    Returns:
        The expected traces; a table per trial with `demonstration`, `group` (`learned`, `left out`, `other
        material`), `rms` and `largest` (deviation in counts over all electrodes and times); and the mean and
        standard deviation over the trials of a group of every electrode's deviation: `group`, `electrode`,
        `time_s`, `mean`, `std`.

    Raises:
        MissingInputError: there is no trial to learn from.
    """
    groups = trial_groups([one.name for one in demonstrations], parameters)
    traces = {one.name: without_offset(one.signal("tactile")) for one in demonstrations}
    dt = demonstrations[0].dt
    learned = [traces[name] for name, group in groups.items() if group == "learned"]
    if not learned:
        raise MissingInputError("there is no slide to learn from")
    primitive = fit_expected_traces(learned, dt, parameters.smoothing_hz)

    deviations = {one.name: deviation(primitive, traces[one.name], one.dt) for one in demonstrations}
    rows = [
        {
            "demonstration": name,
            "group": groups[name],
            "rms": np.sqrt(np.mean(its**2)),
            "largest": np.abs(its).max(),
        }
        for name, its in deviations.items()
    ]
    return primitive, pd.DataFrame(rows), _group_statistics(groups, deviations, dt)


def leave_one_out(
    demonstrations: Sequence[Demonstration], parameters: SlideParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """How every trial deviates from the traces that the other trials of its own material let expect.

    Returns:
        Per trial `demonstration`, `material`, `rms` of the deviation in counts, and its `nmse` over all
        electrodes: 1 is as good as the electrodes' own means over the trial. And the same per trial and
        `channels` (strong or weak ones of its material, or of one of the `PLACES`), with the number of these
        `electrodes`.
    """
    dt = demonstrations[0].dt
    whole, parts = [], []
    for material, traces in _by_material(demonstrations, parameters).items():
        ranges = np.median([np.ptp(trace, axis=0) for trace in traces.values()], axis=0)
        electrodes = np.arange(1, len(ranges) + 1)
        strong = ranges > parameters.strong_counts
        channels = {"strong": strong, "weak": ~strong}
        channels |= {
            name: (electrodes >= first) & (electrodes <= last) for name, (first, last) in PLACES.items()
        }
        for name, trace in traces.items():
            others = [its for other, its in traces.items() if other != name]
            if not others:
                continue
            left = deviation(fit_expected_traces(others, dt, parameters.smoothing_hz), trace, dt)
            whole.append((name, material, *_errors(left, trace)))
            parts += [
                (name, material, group, mask.sum(), *_errors(left[:, mask], trace[:, mask]))
                for group, mask in channels.items()
                if mask.any()
            ]
    columns = ["demonstration", "material", "rms", "nmse"]
    found = pd.DataFrame(whole, columns=columns)
    return found, pd.DataFrame(parts, columns=[*columns[:2], "channels", "electrodes", *columns[2:]])


def across_materials(demonstrations: Sequence[Demonstration], parameters: SlideParameters) -> pd.DataFrame:
    """How the trials of every material deviate from the traces expected of every other one.

    Returns:
        Per material that is `expected` and trial of another: `demonstration`, `material`, `rms`, `nmse`.
    """
    dt = demonstrations[0].dt
    by_material = _by_material(demonstrations, parameters)
    rows = []
    for expected, learned in by_material.items():
        primitive = fit_expected_traces(list(learned.values()), dt, parameters.smoothing_hz)
        rows += [
            (expected, name, material, *_errors(deviation(primitive, trace, dt), trace))
            for material, traces in by_material.items()
            if material != expected
            for name, trace in traces.items()
        ]
    return pd.DataFrame(rows, columns=["expected", "demonstration", "material", "rms", "nmse"])


def _errors(left: np.ndarray, trace: np.ndarray) -> tuple[float, float]:
    """Root mean square of a deviation, and its squared sum over that from the electrodes' own means."""
    own = np.sum((trace - trace.mean(axis=0)) ** 2)
    return np.sqrt(np.mean(left**2)), np.sum(left**2) / own


def _by_material(
    demonstrations: Sequence[Demonstration], parameters: SlideParameters
) -> dict[str, dict[str, np.ndarray]]:
    """Traces (T, E) by material and trial, without the trials that are never learned from."""
    found: dict[str, dict[str, np.ndarray]] = {}
    for one in demonstrations:
        if one.name not in parameters.left_out:
            found.setdefault(material_of(one.name), {})[one.name] = without_offset(one.signal("tactile"))
    return found


def trial_groups(names: Sequence[str], parameters: SlideParameters) -> dict[str, str]:
    """Group of every trial MATERIAL_TRIAL, one of `GROUPS`; see `SlideParameters.material`."""
    sound = Counter(material_of(name) for name in names if name not in parameters.left_out)
    most = sound.most_common(1)
    learned = parameters.material if parameters.material in sound or not most else most[0][0]
    of_sound = {True: "learned", False: "other material"}
    return {
        name: "left out" if name in parameters.left_out else of_sound[material_of(name) == learned]
        for name in names
    }


def _group_statistics(groups: dict[str, str], deviations: dict[str, np.ndarray], dt: float) -> pd.DataFrame:
    """Mean and spread over the trials of a group, on the samples that all trials have."""
    samples = min(len(its) for its in deviations.values())
    tables = []
    for group in dict.fromkeys(groups.values()):
        values = np.array([its[:samples] for name, its in deviations.items() if groups[name] == group])
        electrodes = values.shape[2]
        tables.append(
            pd.DataFrame(
                {
                    "group": group,
                    "electrode": np.repeat(np.arange(1, electrodes + 1), samples),
                    "time_s": np.tile(dt * np.arange(samples), electrodes),
                    "mean": values.mean(axis=0).T.ravel(),
                    "std": values.std(axis=0).T.ravel(),
                }
            )
        )
    return pd.concat(tables, ignore_index=True)
