"""Statistics of simulated and recorded touch per finger, to calibrate the simulated sensor.

Every statistic takes the counts (T, E) of one finger at a constant rate, neither smoothed nor interpolated:
either would remove noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Recording
from structlearn.tasks.touch.touch_names import CALIBRATED, REFERENCE, SCRAPING, SLIDES, UNSCREWING

RANGE_QUANTILES = (0.005, 0.995)  # exclude single spikes from the range
NOISE_WINDOW_S = 0.5  # noise is that of the median window, so that quick motion does not count
FINGERS = ("left", "right")
ELECTRODES = 19  # per finger
CONTACT_COUNTS = 100.0  # contact moves a few electrodes of a finger by more than this, the others by far less
RANKS = {"strongest": 0, "second": 1, "fourth": 3}  # electrodes of a finger in decreasing order, from 0
# bands of the strongest electrode's spectrum in Hz: motion, quick motion, noise
BANDS = {"power_slow": (0.4, 2.0), "power_middle": (2.0, 10.0), "power_fast": (10.0, 50.0)}


class CalibrationParameters(Parameters):
    """Parameters of the comparison of simulated with recorded touch."""

    rate_hz: float = Field(gt=0)
    settling_s: float = Field(ge=0)
    average_s: float = Field(gt=0)
    active_counts: float = Field(gt=0)
    variance: float = Field(gt=0, lt=1)
    segment_s: float = Field(gt=0)
    factor: float = Field(gt=1)

    @property
    def average(self) -> int:
        """Samples of the means before and after contact."""
        return max(round(self.average_s * self.rate_hz), 1)


@dataclass(frozen=True)
class FingerTrace:
    """Counts (T, 19) of one finger in one run of a set, at the sensor's rate."""

    group: str
    run: str
    finger: str
    counts: np.ndarray
    contact: int | None = None  # first sample in steady contact; None: in contact from the start

    @property
    def moving(self) -> np.ndarray:
        """Counts in contact, (T', 19)."""
        return self.counts[self.contact or 0 :]


def in_sets(recordings: Sequence[Recording]) -> dict[str, list[Recording]]:
    """Group recordings named SET/NAME by set; each is renamed NAME."""
    found: dict[str, list[Recording]] = {}
    for one in recordings:
        name, _, rest = one.name.partition("/")
        found.setdefault(name, []).append(replace(one, name=rest))
    return found


def finger_traces(
    group: str, run: str, parts: Sequence[Recording], rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of the fingers in one run, whose primitives may be separate recordings.

    The first primitive makes contact: the first of several recordings, or the first segment of a single one;
    without segments a run is in contact from the start.
    """
    fingers = [_fingers(part, rate_hz) for part in parts]
    contact, segments = None, parts[0].true_segments
    if len(parts) > 1:
        contact = len(fingers[0][0]) + round(settling_s * rate_hz)
    elif segments is not None:
        contact = round((float(segments[0, 1]) + settling_s) * rate_hz)
    traces = zip(FINGERS, zip(*fingers, strict=True), strict=False)
    return [FingerTrace(group, run, finger, np.vstack(its), contact) for finger, its in traces]


def _fingers(recording: Recording, rate_hz: float) -> list[np.ndarray]:
    """Counts (T, 19) of every finger; raises InputError for other numbers of electrodes or a slower rate."""
    fingers: list[np.ndarray] = []
    for stream in (one for one in recording.streams if one.kind == "tactile"):
        step = 1e-9 * float(np.median(np.diff(stream.stamps)))
        values = stream.values  # noqa: PD011 - of a stream
        count, held = values.shape[1], round(1 / (step * rate_hz))
        if count % ELECTRODES:
            raise InputError(f"{recording.name}: has {count} electrodes, a finger has 19")
        if held < 1:
            raise InputError(f"{recording.name}: touch comes at {1 / step:.0f} Hz, not at {rate_hz:g}")
        fingers += np.split(values[::held], count // ELECTRODES, axis=1)
    if not 1 <= len(fingers) <= len(FINGERS):
        raise InputError(f"{recording.name}: has electrodes of {len(fingers)} fingers, not of one or two")
    return fingers


def calibration_traces(
    recorded: Mapping[str, Sequence[Recording]],
    simulated: Sequence[Recording],
    parameters: CalibrationParameters,
) -> list[FingerTrace]:
    """Traces of the recorded sets, keyed by name, and of simulated scraping.

    Raises MissingInputError if no scraping execution is recorded.
    """
    if not recorded.get(SCRAPING):
        raise MissingInputError("no scraping execution is recorded")
    clock = parameters.rate_hz, parameters.settling_s
    traces = finger_traces(REFERENCE, "execution", recorded[SCRAPING], *clock)
    others = {f"{name}, recorded": recorded.get(name, ()) for name in (UNSCREWING, SLIDES)}
    for group, recordings in ({CALIBRATED: simulated} | others).items():
        for one in recordings:
            traces += finger_traces(group, one.name, [one], *clock)
    return traces


def contact_change(counts: np.ndarray, contact: int, average: int) -> np.ndarray:
    """Change of every electrode at contact: mean just before sample `contact` minus mean at the start.

    Raises MissingInputError if the trace ends before contact is made, or if both means overlap.
    """
    if not 2 * average <= contact <= len(counts):
        raise MissingInputError(
            f"contact at sample {contact} and means of {average} do not fit a trace of {len(counts)} samples"
        )
    return counts[contact - average : contact].mean(axis=0) - counts[:average].mean(axis=0)


def movement_range(counts: np.ndarray) -> np.ndarray:
    """Range of every electrode, (E,) counts, between `RANGE_QUANTILES`."""
    return np.diff(np.quantile(counts, RANGE_QUANTILES, axis=0), axis=0)[0]


def noise(counts: np.ndarray, rate_hz: float) -> np.ndarray:
    """Standard deviation of the white noise of every electrode, rounding included, (E,) counts.

    Second differences remove a straight line and multiply the variance of white noise by 6; the root mean
    square is that of the median window. Raises MissingInputError: the trace is shorter than one window.
    """
    window = round(NOISE_WINDOW_S * rate_hz)
    second = np.diff(counts, n=2, axis=0)
    windows = len(second) // window
    if windows < 1:
        raise MissingInputError(
            f"a trace of {len(counts)} samples is too short to measure noise at {rate_hz:g} Hz"
        )
    square = second[: windows * window].reshape(windows, window, -1) ** 2
    return np.sqrt(np.median(square.mean(axis=1), axis=0) / 6)


def spectrum(counts: np.ndarray, rate_hz: float, segment_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (F,) in Hz and power densities (F, E) in counts^2 / Hz, whose integral is the variance.

    By Welch: Hann windows, half overlapping, detrended. Raises MissingInputError: the trace is shorter than
    one window.
    """
    from scipy.signal import welch

    segment = round(segment_s * rate_hz)
    if len(counts) < segment:
        raise MissingInputError(f"a trace of {len(counts) / rate_hz:g} s has no window of {segment_s:g} s")
    return welch(counts, fs=rate_hz, nperseg=segment, detrend="linear", axis=0)


def variance_shares(counts: np.ndarray) -> np.ndarray:
    """Share of the variance in every principal component, (E,), decreasing; zeros if nothing moves."""
    values = np.linalg.svd(counts - counts.mean(axis=0), compute_uv=False) ** 2
    shares = np.zeros(counts.shape[1])
    shares[: len(values)] = values / values.sum() if values.sum() > 0 else 0.0
    return shares


def pca_dimensions(counts: np.ndarray, variance: float) -> int:
    """Smallest number of principal components that hold a share of the variance, e.g. 0.99."""
    return int(np.searchsorted(np.cumsum(variance_shares(counts)), variance * (1 - 1e-12)) + 1)


def calibration_tables(
    traces: Sequence[FingerTrace], parameters: CalibrationParameters
) -> dict[str, pd.DataFrame]:
    """All tables of the comparison.

    Returns:
        `electrodes`: `group`, `run`, `finger`, `electrode`, `contact` (change by contact in counts; NaN if
        always in contact), `range` in contact, `noise`. `fingers`: a column per statistic, by finger and run.
        `spectra`: density in contact of the `median` and of the `strongest` electrode of a finger, by `group`
        and `frequency_hz`. `components`: share of variance `left` in contact, by `group` and number of
        `components`; these two are medians over runs and fingers. `traces`, `comparison`: see the functions.
    """
    electrodes, fingers, spectra, components = [], [], [], []
    for trace in traces:
        keys = {"group": trace.group, "run": trace.run, "finger": trace.finger}
        contact, reach = np.full(ELECTRODES, np.nan), movement_range(trace.moving)
        if trace.contact is not None:
            contact = contact_change(trace.counts, trace.contact, parameters.average)
        by_electrode = {"electrode": np.arange(1, ELECTRODES + 1), "contact": contact, "range": reach}
        by_electrode["noise"] = noise(trace.counts, parameters.rate_hz)
        electrodes.append(pd.DataFrame(keys | by_electrode))
        fingers.append(keys | _finger_statistics(trace, by_electrode, parameters))
        frequency, density = spectrum(trace.moving, parameters.rate_hz, parameters.segment_s)
        strongest = density[:, density.sum(axis=0).argmax()]
        columns = {"frequency_hz": frequency, "median": np.median(density, axis=1), "strongest": strongest}
        spectra.append(pd.DataFrame({"group": trace.group} | columns).iloc[1:])  # no constant
        left = 1 - np.concatenate([[0.0], np.cumsum(variance_shares(trace.moving))])
        numbers = np.arange(ELECTRODES + 1)
        components.append(pd.DataFrame({"group": trace.group, "components": numbers, "left": left}))
    tables = {"electrodes": pd.concat(electrodes, ignore_index=True), "fingers": pd.DataFrame(fingers)}
    for name, its, key in (("spectra", spectra, "frequency_hz"), ("components", components, "components")):
        tables[name] = pd.concat(its).groupby(["group", key], sort=False).median().reset_index()
    tables["traces"] = trace_table(traces, parameters)
    tables["comparison"] = comparison(tables["fingers"], tables["spectra"], parameters.factor)
    return tables


def _finger_statistics(
    trace: FingerTrace, columns: Mapping[str, np.ndarray], parameters: CalibrationParameters
) -> dict[str, float]:
    """Statistics of one finger in one run, from the columns of its electrodes."""
    change, reach = (np.sort(np.abs(columns[name]))[::-1] for name in ("contact", "range"))
    return {
        **{f"contact_{name}": change[place] for name, place in RANKS.items()},
        "contact_median": np.median(change),
        "contact_many": float((change > CONTACT_COUNTS).sum()) if trace.contact else np.nan,
        **{f"range_{name}": reach[place] for name, place in RANKS.items()},
        "range_median": np.median(reach),
        "noise_median": np.median(columns["noise"]),
        "noise_largest": columns["noise"].max(),
        "active": float((reach > parameters.active_counts).sum()),
        "pca_dimensions": float(pca_dimensions(trace.moving, parameters.variance)),
    }


def trace_table(traces: Sequence[FingerTrace], parameters: CalibrationParameters) -> pd.DataFrame:
    """`change` (counts less their mean at the start) in the first run of both sets of scraping.

    By `group`, `finger`, `electrode` and `time_s` since contact.
    """
    tables = []
    for group in (REFERENCE, CALIBRATED):
        run = next(trace.run for trace in traces if trace.group == group)
        for trace in (one for one in traces if (one.group, one.run) == (group, run)):
            change = trace.counts - trace.counts[: parameters.average].mean(axis=0)
            electrode, sample = np.indices(change.T.shape).reshape(2, -1)
            columns = {"electrode": electrode + 1}
            columns |= {"time_s": (sample - (trace.contact or 0)) / parameters.rate_hz}
            columns |= {"change": change.T.ravel()}
            tables.append(pd.DataFrame({"group": group, "finger": trace.finger} | columns))
    return pd.concat(tables, ignore_index=True)


def comparison(fingers: pd.DataFrame, spectra: pd.DataFrame, factor: float) -> pd.DataFrame:
    """Compare simulated with recorded scraping, by statistic.

    Returns `statistic`; the median over runs and fingers and its range for each set, `recorded`,
    `recorded_low`, ...; `ratio` of the medians, simulated to recorded (NaN if both are zero), and `agrees`.
    A band of the spectrum has no range: its amplitude in counts is the root of its power.
    """
    both = []
    for name, group in (("recorded", REFERENCE), ("simulated", CALIBRATED)):
        its = fingers[fingers["group"] == group].drop(columns=["group", "run", "finger"])
        density = spectra[spectra["group"] == group].set_index("frequency_hz")["strongest"]
        step = density.index[1] - density.index[0]
        found = pd.DataFrame({name: its.median(), f"{name}_low": its.min(), f"{name}_high": its.max()})
        for band, (low, high) in BANDS.items():
            inside = (density.index >= low) & (density.index < high)
            found.loc[band, name] = np.sqrt(density.to_numpy()[inside].sum() * step)
        both.append(found)
    table = pd.concat(both, axis=1)
    there = table["recorded"] > 0
    table["ratio"] = (table["simulated"] / table["recorded"]).where(there)
    table["agrees"] = table["ratio"].between(1 / factor, factor) | ~there & (table["simulated"] == 0)
    return table.reset_index(names="statistic")
