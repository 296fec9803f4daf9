"""Simulated touch beside recorded touch: the same statistics of both, finger by finger."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import MissingInputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.recording import Recording
from structlearn.tasks.touch.touch_names import CALIBRATED, REFERENCE, SCRAPING, SLIDES, UNSCREWING
from structlearn.tasks.touch.touch_statistics import (
    ELECTRODES,
    FingerTrace,
    active_electrodes,
    contact_change,
    finger_traces,
    joined,
    movement_range,
    noise,
    pca_dimensions,
    spectrum,
    variance_shares,
)

CONTACT_COUNTS = 100.0
"""Contact moves a few electrodes of a finger by more than this, and the others by far less."""

BANDS = (("power_slow", 0.4, 2.0), ("power_middle", 2.0, 10.0), ("power_fast", 10.0, 50.0))
"""Bands of the strongest electrode's spectrum in Hz: motion, quick motion, noise."""


class CalibrationParameters(Parameters):
    """Parameters of the comparison."""

    rate_hz: float = Field(gt=0)
    settling_s: float = Field(ge=0)
    average_s: float = Field(gt=0)
    active_counts: float = Field(gt=0)
    variance: float = Field(gt=0, lt=1)
    segment_s: float = Field(gt=0)
    factor: float = Field(gt=1)


def calibration_traces(
    recorded: Mapping[str, Sequence[Recording]],
    simulated: Sequence[Recording | Demonstration],
    parameters: CalibrationParameters,
) -> list[FingerTrace]:
    """Traces of the recorded sets, by their names, and of simulated scraping.

    Raises:
        MissingInputError: no scraping execution is recorded.
    """
    if not recorded.get(SCRAPING):
        raise MissingInputError("no scraping execution is recorded")
    clock = parameters.rate_hz, parameters.settling_s
    traces = joined(REFERENCE, "execution", recorded[SCRAPING], *clock)
    others = {f"{name}, recorded": recorded.get(name, ()) for name in (UNSCREWING, SLIDES)}
    for group, recordings in ({CALIBRATED: simulated} | others).items():
        traces += [trace for one in recordings for trace in finger_traces(group, one, *clock)]
    return traces


def calibration_tables(
    traces: Sequence[FingerTrace], parameters: CalibrationParameters
) -> dict[str, pd.DataFrame]:
    """All tables of the comparison.

    Returns:
        `electrodes`, `fingers`, `spectra`, `components`, `traces` and `comparison`: see the functions that
        make them. `components` has per `group` and number of `components` of a finger, 0 to 19, the share of
        variance `left` over in contact, median over runs and fingers.
    """
    electrodes = electrode_table(traces, parameters)
    fingers, spectra = finger_table(traces, electrodes, parameters), spectrum_table(traces, parameters)
    held = [np.cumsum(variance_shares(trace.moving)) for trace in traces]
    numbers = np.arange(ELECTRODES + 1)
    rows = [
        pd.DataFrame({"group": trace.group, "components": numbers, "left": 1 - np.concatenate([[0.0], its])})
        for trace, its in zip(traces, held, strict=True)
    ]
    return {
        "electrodes": electrodes,
        "fingers": fingers,
        "spectra": spectra,
        "components": pd.concat(rows).groupby(["group", "components"], sort=False).median().reset_index(),
        "traces": trace_table(traces, parameters),
        "comparison": comparison(fingers, spectra, parameters),
    }


def electrode_table(traces: Sequence[FingerTrace], parameters: CalibrationParameters) -> pd.DataFrame:
    """Statistics of every electrode.

    Returns:
        `group`, `run`, `finger`, `electrode`, `contact` (change by contact in counts; NaN if always in
        contact), `range` in contact, `noise`.
    """
    average = max(round(parameters.average_s * parameters.rate_hz), 1)
    tables = []
    for trace in traces:
        contact = np.full(ELECTRODES, np.nan)
        if trace.contact is not None:
            contact = contact_change(trace.counts, trace.contact, average)
        columns = {
            "electrode": np.arange(1, ELECTRODES + 1),
            "contact": contact,
            "range": movement_range(trace.moving),
            "noise": noise(trace.counts, parameters.rate_hz),
        }
        names = {"group": trace.group, "run": trace.run, "finger": trace.finger}
        tables.append(pd.DataFrame(names | columns))
    return pd.concat(tables, ignore_index=True)


def spectrum_table(traces: Sequence[FingerTrace], parameters: CalibrationParameters) -> pd.DataFrame:
    """Power densities in contact.

    Returns:
        Per `group` and `frequency_hz` in counts^2 / Hz: of the `median` electrode and of the `strongest` one
        of a finger, each the median over runs and fingers.
    """
    rows = []
    for trace in traces:
        frequency, density = spectrum(trace.moving, parameters.rate_hz, parameters.segment_s)
        strongest = density[:, density.sum(axis=0).argmax()]
        columns = {"frequency_hz": frequency, "median": np.median(density, axis=1), "strongest": strongest}
        rows.append(pd.DataFrame({"group": trace.group} | columns))
    table = pd.concat(rows).groupby(["group", "frequency_hz"], sort=False).median().reset_index()
    return table[table["frequency_hz"] > 0].reset_index(drop=True)


def trace_table(traces: Sequence[FingerTrace], parameters: CalibrationParameters) -> pd.DataFrame:
    """Traces of the first run of both sets of scraping, to look at.

    Returns:
        `group`, `finger`, `electrode`, `time_s` since the contact, `change` (counts less the mean at the
        start of the run).
    """
    average = max(round(parameters.average_s * parameters.rate_hz), 1)
    tables = []
    for group in (REFERENCE, CALIBRATED):
        run = next(trace.run for trace in traces if trace.group == group)
        for trace in (one for one in traces if (one.group, one.run) == (group, run)):
            change = trace.counts - trace.counts[:average].mean(axis=0)
            time = (np.arange(len(change)) - (trace.contact or 0)) / parameters.rate_hz
            columns = {
                "electrode": np.repeat(np.arange(1, ELECTRODES + 1), len(change)),
                "time_s": np.tile(time, ELECTRODES),
                "change": change.T.ravel(),
            }
            tables.append(pd.DataFrame({"group": group, "finger": trace.finger} | columns))
    return pd.concat(tables, ignore_index=True)


def finger_table(
    traces: Sequence[FingerTrace], electrodes: pd.DataFrame, parameters: CalibrationParameters
) -> pd.DataFrame:
    """The statistics that are compared, finger by finger: `group`, `run`, `finger`, then one column each."""
    by_finger = dict(list(electrodes.groupby(["group", "run", "finger"], sort=False)))
    rows = []
    for trace in traces:
        its = by_finger[trace.group, trace.run, trace.finger]
        change = np.sort(its["contact"].abs().to_numpy())[::-1]
        reach = np.sort(its["range"].to_numpy())[::-1]
        rows.append(
            {
                "group": trace.group,
                "run": trace.run,
                "finger": trace.finger,
                "contact_strongest": change[0],
                "contact_second": change[1],
                "contact_fourth": change[3],
                "contact_median": np.median(change),
                "contact_many": float((change > CONTACT_COUNTS).sum()) if trace.contact else np.nan,
                "range_strongest": reach[0],
                "range_second": reach[1],
                "range_fourth": reach[3],
                "range_median": np.median(reach),
                "noise_median": its["noise"].median(),
                "noise_largest": its["noise"].max(),
                "active": float(active_electrodes(trace.moving, parameters.active_counts)),
                "pca_dimensions": float(pca_dimensions(trace.moving, parameters.variance)),
            }
        )
    return pd.DataFrame(rows)


def comparison(
    fingers: pd.DataFrame, spectra: pd.DataFrame, parameters: CalibrationParameters
) -> pd.DataFrame:
    """Simulated beside recorded scraping, statistic by statistic.

    Returns:
        `statistic`, and of both sets the median over runs and fingers with its range: `recorded`,
        `recorded_low`, `recorded_high`, `simulated`, `simulated_low`, `simulated_high`; `ratio` of the
        medians, simulated to recorded (NaN for nothing over nothing), and `agrees`.
    """
    both: dict[str, list[tuple[float, float, float]]] = {}
    for name in fingers.columns.drop(["group", "run", "finger"]):
        values = [fingers.loc[fingers["group"] == group, name] for group in (REFERENCE, CALIBRATED)]
        both[name] = [(float(its.median()), float(its.min()), float(its.max())) for its in values]
    for name, low, high in BANDS:
        bands = [_band(spectra[spectra["group"] == group], low, high) for group in (REFERENCE, CALIBRATED)]
        both[name] = [(value, np.nan, np.nan) for value in bands]
    return pd.DataFrame([_compared(name, its, parameters.factor) for name, its in both.items()])


def _band(spectra: pd.DataFrame, low: float, high: float) -> float:
    """Amplitude in a band, counts: the root of the power of the strongest electrode."""
    frequency = spectra["frequency_hz"].to_numpy()
    inside = (frequency >= low) & (frequency < high)
    return float(np.sqrt(spectra["strongest"].to_numpy()[inside].sum() * (frequency[1] - frequency[0])))


def _compared(name: str, both: Sequence[tuple[float, float, float]], factor: float) -> Mapping[str, object]:
    (recorded, recorded_low, recorded_high), (simulated, simulated_low, simulated_high) = both
    ratio = simulated / recorded if recorded > 0 else np.nan
    return {
        "statistic": name,
        "recorded": recorded,
        "recorded_low": recorded_low,
        "recorded_high": recorded_high,
        "simulated": simulated,
        "simulated_low": simulated_low,
        "simulated_high": simulated_high,
        "ratio": ratio,
        "agrees": bool(1 / factor <= ratio <= factor) if recorded > 0 else simulated == 0,
    }
