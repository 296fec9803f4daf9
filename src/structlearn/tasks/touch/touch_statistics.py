"""What touch looks like in numbers, the same for recorded and simulated traces of fingers.

Every statistic takes the counts (T, E) of one finger at a constant rate, as the sensor gave them: neither
smoothed nor interpolated, for that would take noise away.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.recording import Recording

RANGE_QUANTILES = (0.005, 0.995)
"""A range leaves out this much at either end: single spikes are no motion."""

NOISE_WINDOW_S = 0.5
"""Noise is measured in windows of this length, and the median window counts: quick motion is no noise."""

FINGERS = ("left", "right")
ELECTRODES = 19
"""Of one finger."""


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
    fingers: list[np.ndarray] = []
    for values, step in _touch(recording):
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


def _touch(recording: Recording | Demonstration) -> list[tuple[np.ndarray, float]]:
    """Readings (T, E) and their step in s; of a run those of all fingers are side by side."""
    if isinstance(recording, Demonstration):
        return [(recording.signal("tactile"), recording.dt)]
    touch = [stream for stream in recording.streams if stream.kind == "tactile"]
    return [(stream.values, 1e-9 * float(np.median(np.diff(stream.stamps)))) for stream in touch]


def joined(
    group: str, run: str, parts: Sequence[Recording], rate_hz: float, settling_s: float = 0.0
) -> list[FingerTrace]:
    """Traces of one run whose primitives were recorded as files of their own; the first makes the contact."""
    traces = zip(*(finger_traces(group, part, rate_hz) for part in parts), strict=True)
    settled = round(settling_s * rate_hz)
    return [
        FingerTrace(
            group, run, its[0].finger, np.vstack([one.counts for one in its]), len(its[0].counts) + settled
        )
        for its in traces
    ]


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


def active_electrodes(counts: np.ndarray, threshold_counts: float) -> int:
    """How many electrodes move by more than a threshold (`movement_range`)."""
    return int((movement_range(counts) > threshold_counts).sum())


def variance_shares(counts: np.ndarray) -> np.ndarray:
    """Share of the variance in every principal component, (E,), falling; zeros if nothing moves."""
    values = np.linalg.svd(counts - counts.mean(axis=0), compute_uv=False) ** 2
    shares = np.zeros(counts.shape[1])
    shares[: len(values)] = values / values.sum() if values.sum() > 0 else 0.0
    return shares


def pca_dimensions(counts: np.ndarray, variance: float) -> int:
    """Smallest number of principal components that hold a share of the variance, e.g. 0.99."""
    return int(np.searchsorted(np.cumsum(variance_shares(counts)), variance * (1 - 1e-12)) + 1)
