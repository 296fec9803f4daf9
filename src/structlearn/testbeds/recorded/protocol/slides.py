"""Recorded slides of a tactile finger: expected traces of one material, deviations on another."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.primitives.sensor_traces import deviation, fit_expected_traces, without_offset
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings.clock import held_out_error
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.recording import Recording

GROUPS = ("left out", "other material", "learned")
"""Groups of trials, the most telling first."""


class SlideParameters(Parameters):
    """Parameters of the slides.

    Attributes:
        rate_hz: of the clock on which all streams are put.
        max_gap_s: longest hole that is bridged.
        material: the expected traces are those of this one.
        left_out: numbers of its trials that are never learned from.
        smoothing_hz: low-pass of the electrodes before they are differentiated.
    """

    rate_hz: float = Field(gt=0)
    max_gap_s: float = Field(gt=0)
    material: str
    left_out: tuple[int, ...] = Field(min_length=1)
    smoothing_hz: float = Field(gt=0)


def clock_errors(recordings: Sequence[Recording]) -> pd.DataFrame:
    """What it costs to put the streams on one clock: error of interpolation, measured on held-out samples.

    Args:
        recordings: the raw streams.

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

    Args:
        demonstrations: named MATERIAL_TRIAL, with tactile signals.
        parameters: see there.

    Returns:
        The expected traces; a table per trial with `demonstration`, `group` (`learned`, `left out`, `other
        material`), `rms` and `largest` (deviation in counts over all electrodes and times); and the mean and
        standard deviation over the trials of a group of every electrode's deviation: `group`, `electrode`,
        `time_s`, `mean`, `std`.

    Raises:
        InputError: there is no trial to learn from.
    """
    groups = {one.name: trial_group(one.name, parameters) for one in demonstrations}
    traces = {one.name: without_offset(one.tactile) for one in demonstrations}
    dt = demonstrations[0].dt
    learned = [traces[name] for name, group in groups.items() if group == "learned"]
    if not learned:
        raise InputError(f"recorded_slides: there is no trial of '{parameters.material}' to learn from")
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


def leave_one_out(demonstrations: Sequence[Demonstration], parameters: SlideParameters) -> pd.DataFrame:
    """How every trial deviates from the traces that the other trials of its own material let expect.

    Args:
        demonstrations: named MATERIAL_TRIAL, with tactile signals.
        parameters: see there; trials that are never learned from are not asked about either.

    Returns:
        Per trial `demonstration`, `material`, `rms` of the deviation in counts, and its `nmse` over all
        electrodes: 1 is as good as the electrodes' own means over the trial.
    """
    traces = {one.name: without_offset(one.tactile) for one in demonstrations}
    dt = demonstrations[0].dt
    rows = []
    for name, trace in traces.items():
        material = name.split("_")[0]
        others = [
            its
            for other, its in traces.items()
            if other != name
            and other.startswith(f"{material}_")
            and trial_group(other, parameters) != "left out"
        ]
        if others and trial_group(name, parameters) != "left out":
            left = deviation(fit_expected_traces(others, dt, parameters.smoothing_hz), trace, dt)
            own = np.sum((trace - trace.mean(axis=0)) ** 2)
            rows.append((name, material, np.sqrt(np.mean(left**2)), np.sum(left**2) / own))
    return pd.DataFrame(rows, columns=["demonstration", "material", "rms", "nmse"])


def trial_group(name: str, parameters: SlideParameters) -> str:
    """Group of a trial MATERIAL_TRIAL: one of `GROUPS`."""
    material, trial = name.split("_")
    if material != parameters.material:
        return "other material"
    return "left out" if int(trial) in parameters.left_out else "learned"


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
