"""What touch looks like in numbers, the same for recorded and simulated traces.

Every function takes the counts (T, E) of one finger or of several beside each other, at a constant rate, as
the sensor gave them: not smoothed and not interpolated, for that would take noise away.
"""

import numpy as np

from structlearn.ground.errors import MissingInputError

RANGE_QUANTILES = (0.005, 0.995)
"""A range leaves out this much at either end: single spikes are no motion."""

NOISE_WINDOW_S = 0.5
"""Noise is measured in windows of this length, and the median window counts: quick motion is no noise."""


def contact_change(counts: np.ndarray, contact: int, average: int) -> np.ndarray:
    """How far contact moved every electrode: mean of the samples before `contact` less that of the first.

    Args:
        counts: (T, E).
        contact: sample at which the contact is made.
        average: samples of both means.

    Returns:
        (E,) counts.

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
    """Standard deviation of the white noise of every electrode, rounding included.

    Second differences take a straight line away and multiply the variance of white noise by 6. The root mean
    square is that of the median window.

    Args:
        counts: (T, E).
        rate_hz: of the samples.

    Returns:
        (E,) counts.

    Raises:
        MissingInputError: the trace is shorter than one window.
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

    Args:
        counts: (T, E).
        rate_hz: of the samples.
        segment_s: length of a window.

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
