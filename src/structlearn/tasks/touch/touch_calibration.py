"""Simulated touch beside recorded touch: the same statistics of both, finger by finger.

Every statistic takes the counts (T, E) of one finger at a constant rate, as the sensor gave them: neither
smoothed nor interpolated, for that would take noise away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Demonstration, Recording
from structlearn.tasks.touch.touch_names import CALIBRATED, REFERENCE, SCRAPING, SLIDES, UNSCREWING

RANGE_QUANTILES = (0.005, 0.995)
"""A range leaves out this much at either end: single spikes are no motion."""

NOISE_WINDOW_S = 0.5
"""Noise is measured in windows of this length, and the median window counts: quick motion is no noise."""

FINGERS = ("left", "right")
ELECTRODES = 19
"""Of one finger."""

CONTACT_COUNTS = 100.0
"""Contact moves a few electrodes of a finger by more than this, and the others by far less."""

RANKS = {"strongest": 0, "second": 1, "fourth": 3}
"""Electrodes of a finger in falling order, from 0."""

BANDS = {"power_slow": (0.4, 2.0), "power_middle": (2.0, 10.0), "power_fast": (10.0, 50.0)}
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

    @property
    def average(self) -> int:
        """Samples of the means before and after contact."""
        return max(round(self.average_s * self.rate_hz), 1)


@dataclass(frozen=True)
class FingerTrace:
    """What one finger read in one run of a set: counts (T, 19) at the sensor's rate."""

    group: str
    run: str
    finger: str
    counts: np.ndarray
    contact: int | None = None  # sample from which on the contact stands; None: from the start

    @property
    def moving(self) -> np.ndarray:
        """The part in contact, (T', 19)."""
        return self.counts[self.contact or 0 :]


def in_sets(recordings: Sequence[Recording]) -> dict[str, list[Recording]]:
    """Recordings called SET/NAME, by NAME and by their set."""
    found: dict[str, list[Recording]] = {}
    for one in recordings:
        name, _, rest = one.name.partition("/")
        found.setdefault(name, []).append(replace(one, name=rest))
    return found


def finger_traces(
    group: str, recording: Recording | Demonstration, rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of the fingers of one recording; where its segments are known, the first one makes the contact.

    Raises:
        InputError: there are no electrodes, not 19 per finger, or they come slower than `rate_hz`.
    """
    if isinstance(recording, Demonstration):  # those of all fingers are side by side
        touch = [(recording.signal("tactile"), recording.dt)]
    else:
        touch = [
            (stream.values, 1e-9 * float(np.median(np.diff(stream.stamps))))  # noqa: PD011 - of a stream
            for stream in recording.streams
            if stream.kind == "tactile"
        ]
    fingers: list[np.ndarray] = []
    for values, step in touch:
        count = values.shape[1]
        if count % ELECTRODES:
            raise InputError(f"{recording.name}: has {count} electrodes, a finger has 19")
        held = round(1 / (step * rate_hz))
        if held < 1:
            raise InputError(f"{recording.name}: touch comes at {1 / step:.0f} Hz, not at {rate_hz:g}")
        fingers += np.split(values[::held], count // ELECTRODES, axis=1)
    if not 1 <= len(fingers) <= len(FINGERS):
        raise InputError(f"{recording.name}: has electrodes of {len(fingers)} fingers, not of one or two")
    segments = recording.true_segments
    contact = None if segments is None else round((float(segments[0, 1]) + settling_s) * rate_hz)
    named = zip(FINGERS, fingers, strict=False)
    return [FingerTrace(group, recording.name, finger, counts, contact) for finger, counts in named]


def joined(
    group: str, run: str, parts: Sequence[Recording], rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of one run whose primitives were recorded as files of their own; the first makes the contact."""
    settled, found = round(settling_s * rate_hz), []
    for its in zip(*(finger_traces(group, part, rate_hz) for part in parts), strict=True):
        counts = np.vstack([one.counts for one in its])
        found.append(FingerTrace(group, run, its[0].finger, counts, len(its[0].counts) + settled))
    return found


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


def contact_change(counts: np.ndarray, contact: int, average: int) -> np.ndarray:
    """How far contact moved every electrode: mean of the samples before `contact` less that of the first.

    Raises:
        MissingInputError: the trace ends before the contact is made, or both means overlap.
    """
    if not 2 * average <= contact <= len(counts):
        raise MissingInputError(
            f"contact at sample {contact} and means of {average} do not fit a trace of {len(counts)} samples"
        )
    return counts[contact - average : contact].mean(axis=0) - counts[:average].mean(axis=0)


def movement_range(counts: np.ndarray) -> np.ndarray:
    """Range of every electrode, (E,) counts, between `RANGE_QUANTILES`."""
    low, high = np.quantile(counts, RANGE_QUANTILES, axis=0)
    return high - low


def noise(counts: np.ndarray, rate_hz: float) -> np.ndarray:
    """Standard deviation of the white noise of every electrode, rounding included, (E,) counts.

    Second differences take a straight line away and multiply the variance of white noise by 6. The root mean
    square is that of the median window; a MissingInputError where the trace is shorter than one.
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
    """Power density of every electrode (Welch: Hann windows, half overlapping, straight lines taken away).

    Returns:
        Frequencies (F,) in Hz and densities (F, E) in counts^2 / Hz; their integral is the variance.

    Raises:
        MissingInputError: the trace is shorter than one window.
    """
    from scipy.signal import welch

    segment = round(segment_s * rate_hz)
    if len(counts) < segment:
        raise MissingInputError(f"a trace of {len(counts) / rate_hz:g} s has no window of {segment_s:g} s")
    return welch(counts, fs=rate_hz, nperseg=segment, detrend="linear", axis=0)


def variance_shares(counts: np.ndarray) -> np.ndarray:
    """Share of the variance in every principal component, (E,), falling; zeros if nothing moves."""
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
        always in contact), `range` in contact, `noise`. `fingers`: per finger of a run, a column for each
        statistic that is compared. `spectra`: per `group` and `frequency_hz` the density in contact, in
        counts^2 / Hz, of the `median` electrode and of the `strongest` one of a finger. `components`: per
        `group` and number of `components` of a finger, 0 to 19, the share of variance `left` in contact.
        These two are medians over runs and fingers. `traces`: see `trace_table`; `comparison`: likewise.
    """
    electrodes, fingers, spectra, components = [], [], [], []
    for trace in traces:
        keys = {"group": trace.group, "run": trace.run, "finger": trace.finger}
        contact = np.full(ELECTRODES, np.nan)
        if trace.contact is not None:
            contact = contact_change(trace.counts, trace.contact, parameters.average)
        columns = {"electrode": np.arange(1, ELECTRODES + 1), "contact": contact}
        columns |= {"range": movement_range(trace.moving), "noise": noise(trace.counts, parameters.rate_hz)}
        electrodes.append(pd.DataFrame(keys | columns))
        change, reach = (np.sort(np.abs(columns[name]))[::-1] for name in ("contact", "range"))
        fingers.append(
            keys
            | {f"contact_{name}": change[place] for name, place in RANKS.items()}
            | {
                "contact_median": np.median(change),
                "contact_many": float((change > CONTACT_COUNTS).sum()) if trace.contact else np.nan,
            }
            | {f"range_{name}": reach[place] for name, place in RANKS.items()}
            | {
                "range_median": np.median(reach),
                "noise_median": np.median(columns["noise"]),
                "noise_largest": columns["noise"].max(),
                "active": float((reach > parameters.active_counts).sum()),
                "pca_dimensions": float(pca_dimensions(trace.moving, parameters.variance)),
            }
        )
        frequency, density = spectrum(trace.moving, parameters.rate_hz, parameters.segment_s)
        spectra.append(
            pd.DataFrame(
                {
                    "group": trace.group,
                    "frequency_hz": frequency,
                    "median": np.median(density, axis=1),
                    "strongest": density[:, density.sum(axis=0).argmax()],
                }
            ).iloc[1:]  # no constant
        )
        left = 1 - np.concatenate([[0.0], np.cumsum(variance_shares(trace.moving))])
        numbers = np.arange(ELECTRODES + 1)
        components.append(pd.DataFrame({"group": trace.group, "components": numbers, "left": left}))
    tables = {"electrodes": pd.concat(electrodes, ignore_index=True), "fingers": pd.DataFrame(fingers)}
    for name, its, key in (("spectra", spectra, "frequency_hz"), ("components", components, "components")):
        tables[name] = pd.concat(its).groupby(["group", key], sort=False).median().reset_index()
    tables["traces"] = trace_table(traces, parameters)
    tables["comparison"] = comparison(tables["fingers"], tables["spectra"], parameters.factor)
    return tables


def trace_table(traces: Sequence[FingerTrace], parameters: CalibrationParameters) -> pd.DataFrame:
    """Traces of the first run of both sets of scraping, to look at.

    Returns:
        `group`, `finger`, `electrode`, `time_s` since the contact, `change` (counts less the mean at the
        start of the run).
    """
    tables = []
    for group in (REFERENCE, CALIBRATED):
        run = next(trace.run for trace in traces if trace.group == group)
        for trace in (one for one in traces if (one.group, one.run) == (group, run)):
            change = trace.counts - trace.counts[: parameters.average].mean(axis=0)
            time = (np.arange(len(change)) - (trace.contact or 0)) / parameters.rate_hz
            columns = {
                "electrode": np.repeat(np.arange(1, ELECTRODES + 1), len(change)),
                "time_s": np.tile(time, ELECTRODES),
                "change": change.T.ravel(),
            }
            tables.append(pd.DataFrame({"group": group, "finger": trace.finger} | columns))
    return pd.concat(tables, ignore_index=True)


def comparison(fingers: pd.DataFrame, spectra: pd.DataFrame, factor: float) -> pd.DataFrame:
    """Simulated beside recorded scraping, statistic by statistic.

    Returns:
        `statistic`, and of both sets the median over runs and fingers with its range: `recorded`,
        `recorded_low`, `recorded_high`, `simulated`, `simulated_low`, `simulated_high`; `ratio` of the
        medians, simulated to recorded (NaN for nothing over nothing), and `agrees`. Bands of the spectrum
        have no range: theirs is the amplitude in counts, the root of the strongest electrode's power.
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
