"""Statistics of recorded and of simulated touch, finger by finger.

Every statistic takes the counts (T, E) of one finger at the sensor's rate, neither smoothed nor interpolated:
either would remove noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.demonstration import Recording

RATE_HZ = 100.0  # of the sensor; a log that holds values at a higher rate is thinned
SETTLING_S = 0.5  # after the first primitive until force control holds; contact counts from there on
AVERAGE = 10  # samples of the means before and after contact
ACTIVE_COUNTS = 20.0  # by which an active electrode moves in contact, far above the noise
CONTACT_COUNTS = 100.0  # contact moves a few electrodes of a finger by more than this, the others by far less
VARIANCE = 0.99  # share that the principal components must hold
SEGMENT_S = 2.56  # windows of the spectra
RANGE_QUANTILES = (0.005, 0.995)  # exclude single spikes from the range
NOISE_WINDOW_S = 0.5  # noise is that of the median window, so that quick motion does not count
ELECTRODES = 19  # per finger
RANKS = {"strongest": 0, "second": 1, "fourth": 3}  # electrodes of a finger in decreasing order, from 0
# Hz, bands of the strongest electrode's spectrum: motion, quick motion, noise
BANDS = {"0.4 to 2 Hz": (0.4, 2.0), "2 to 10 Hz": (2.0, 10.0), "10 to 50 Hz": (10.0, 50.0)}


@dataclass(frozen=True)
class FingerTrace:
    """Counts (T, 19) of one finger in one execution, at the sensor's rate."""

    counts: np.ndarray
    contact: int  # first sample in steady contact

    @property
    def moving(self) -> np.ndarray:
        """Counts in contact, (T', 19)."""
        return self.counts[self.contact :]


def compared(recorded: Sequence[Recording], simulated: Sequence[Recording]) -> pd.DataFrame:
    """Compare an execution, recorded primitive by primitive, with simulated ones.

    Returns one row per `quantity` and `case`: medians over fingers and executions, `recorded` and
    `simulated`, their ranges `recorded_low`, ..., and `ratio`, simulated over recorded.

    Raises InputError: a recording has no fingers, or is too short.
    """
    both = {
        "recorded": finger_traces(recorded),
        "simulated": [trace for one in simulated for trace in finger_traces([one])],
    }
    columns: dict[str, pd.Series] = {}
    for name, traces in both.items():
        found = pd.concat([pd.Series(statistics(trace)) for trace in traces], axis=1)
        ends = {f"{name}_low": found.min(axis=1), f"{name}_high": found.max(axis=1)}
        columns |= {name: found.median(axis=1)} | ends
    table = pd.DataFrame(columns).assign(ratio=columns["simulated"] / columns["recorded"])
    return table.rename_axis(["quantity", "case"]).reset_index()


def finger_traces(parts: Sequence[Recording]) -> list[FingerTrace]:
    """Traces of the fingers in one execution, whose primitives may be separate recordings.

    The first primitive makes contact: the first recording of several, or the first segment of a single one.
    """
    fingers = [_fingers(part) for part in parts]
    segments = parts[0].true_segments
    first = len(fingers[0][0])
    if len(parts) == 1:
        if segments is None:
            raise InputError(f"{parts[0].name}: has no segments, of which the first makes contact")
        first = round(float(segments[0, 1]) * RATE_HZ)
    return [
        FingerTrace(np.vstack(its), first + round(SETTLING_S * RATE_HZ)) for its in zip(*fingers, strict=True)
    ]


def _fingers(recording: Recording) -> list[np.ndarray]:
    """Counts (T, 19) of every finger; raises InputError for other numbers of electrodes or a slower rate."""
    fingers: list[np.ndarray] = []
    for stream in (one for one in recording.streams if one.kind == "tactile"):
        step = 1e-9 * float(np.median(np.diff(stream.stamps)))
        values = stream.values  # noqa: PD011 - of a stream
        count, held = values.shape[1], round(1 / (step * RATE_HZ))
        if count % ELECTRODES:
            raise InputError(f"{recording.name}: has {count} electrodes, a finger has 19")
        if held < 1:
            raise InputError(f"{recording.name}: touch comes at {1 / step:.0f} Hz, not at {RATE_HZ:g}")
        fingers += np.split(values[::held], count // ELECTRODES, axis=1)
    if not fingers:
        raise InputError(f"{recording.name}: has no electrodes")
    return fingers


def statistics(trace: FingerTrace) -> Mapping[tuple[str, str], float]:
    """Statistics of one finger in one execution, by quantity and case."""
    change = np.sort(np.abs(contact_change(trace.counts, trace.contact)))[::-1]
    reach, white = np.sort(movement_range(trace.moving))[::-1], noise(trace.counts)
    found: dict[tuple[str, str], float] = {}
    for quantity, values in (("contact", change), ("range", reach)):
        found |= {(quantity, f"{name} electrode (counts)"): values[rank] for name, rank in RANKS.items()}
        found[quantity, "median electrode (counts)"] = np.median(values)
    found["contact", f"electrodes beyond {CONTACT_COUNTS:g} counts"] = (change > CONTACT_COUNTS).sum()
    found["noise", "median electrode (counts)"] = np.median(white)
    found["noise", "noisiest electrode (counts)"] = white.max()
    found["active", "electrodes"] = (reach > ACTIVE_COUNTS).sum()
    found["dimensions", "principal components"] = pca_dimensions(trace.moving, VARIANCE)
    frequency, density = spectrum(trace.moving)
    strongest = density[:, density.sum(axis=0).argmax()]
    for band, (low, high) in BANDS.items():  # amplitudes are roots of the power
        power = strongest[(frequency >= low) & (frequency < high)].sum() * frequency[1]
        found["spectrum", f"{band} (counts)"] = np.sqrt(power)
    return found


def contact_change(counts: np.ndarray, contact: int) -> np.ndarray:
    """Change of every electrode at contact: mean just before sample `contact` minus mean at the start.

    Raises MissingInputError if the trace ends before contact is made, or if both means overlap.
    """
    if not 2 * AVERAGE <= contact <= len(counts):
        raise MissingInputError(
            f"contact at sample {contact} and means of {AVERAGE} do not fit a trace of {len(counts)} samples"
        )
    return counts[contact - AVERAGE : contact].mean(axis=0) - counts[:AVERAGE].mean(axis=0)


def movement_range(counts: np.ndarray) -> np.ndarray:
    """Range of every electrode, (E,) counts, between `RANGE_QUANTILES`."""
    return np.diff(np.quantile(counts, RANGE_QUANTILES, axis=0), axis=0)[0]


def noise(counts: np.ndarray) -> np.ndarray:
    """Standard deviation of the white noise of every electrode, rounding included, (E,) counts.

    Second differences remove a straight line and multiply the variance of white noise by 6; the root mean
    square is that of the median window. Raises MissingInputError: the trace is shorter than one window.
    """
    window = round(NOISE_WINDOW_S * RATE_HZ)
    second = np.diff(counts, n=2, axis=0)
    windows = len(second) // window
    if windows < 1:
        raise MissingInputError(f"a trace of {len(counts)} samples is too short to measure noise")
    square = second[: windows * window].reshape(windows, window, -1) ** 2
    return np.sqrt(np.median(square.mean(axis=1), axis=0) / 6)


def spectrum(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (F,) in Hz and power densities (F, E) in counts^2 / Hz, whose integral is the variance.

    By Welch: Hann windows, half overlapping, detrended. Raises MissingInputError: the trace is shorter than
    one window.
    """
    from scipy.signal import welch

    segment = round(SEGMENT_S * RATE_HZ)
    if len(counts) < segment:
        raise MissingInputError(f"a trace of {len(counts) / RATE_HZ:g} s has no window of {SEGMENT_S:g} s")
    return welch(counts, fs=RATE_HZ, nperseg=segment, detrend="linear", axis=0)


def pca_dimensions(counts: np.ndarray, variance: float) -> int:
    """Smallest number of principal components that hold a share of the variance, e.g. 0.99."""
    values = np.linalg.svd(counts - counts.mean(axis=0), compute_uv=False) ** 2
    return int(np.searchsorted(np.cumsum(values), variance * (1 - 1e-12) * values.sum()) + 1)
