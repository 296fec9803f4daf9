"""Signals on a uniform clock: filters, derivatives, time normalisation; the minimum-jerk profile."""

from functools import cache
from typing import TypeVar

import numpy as np

Fraction = TypeVar("Fraction", float, np.ndarray)

BUTTERWORTH_ORDER = 2  # run forwards and backwards, so the effective order is doubled


def low_pass(signal: np.ndarray, dt: float, cutoff_hz: float) -> np.ndarray:
    """Zero-phase Butterworth low-pass along the first axis: (T, ...) -> (T, ...), `dt` in s.

    The ends are extended by odd reflection, which preserves value and slope there. A cut-off at or above half
    the sampling rate leaves the signal unchanged.
    """
    from scipy.signal import sosfiltfilt

    nyquist = 0.5 / dt
    if cutoff_hz >= nyquist:
        return np.array(signal, dtype=float)
    padding = min(len(signal) - 1, int(np.ceil(1.0 / (cutoff_hz * dt))))  # one period of the cut-off
    return sosfiltfilt(_sections(cutoff_hz / nyquist), signal, axis=0, padtype="odd", padlen=padding)


def derivative(signal: np.ndarray, dt: float) -> np.ndarray:
    """Second-order finite differences, central inside: (T, ...) -> (T, ...) per s, T >= 3, `dt` in s."""
    return np.gradient(signal, dt, axis=0, edge_order=2)


def standardise(signal: np.ndarray) -> np.ndarray:
    """Zero mean and unit variance per column, (T, ...); constant columns become zero."""
    spread = signal.std(axis=0)
    return (signal - signal.mean(axis=0)) / np.where(spread > 0, spread, 1.0)


def standardise_together(signal: np.ndarray) -> np.ndarray:
    """Zero mean per column, and unit variance of all columns together, (T, D); constants become zero."""
    centred = signal - signal.mean(axis=0)
    spread = np.linalg.norm(centred) / np.sqrt(len(centred))
    return centred / spread if spread > 0 else centred


def time_normalised(signal: np.ndarray, count: int) -> np.ndarray:
    """Linear resampling at `count` points from start to end, (T, ...) -> (count, ...)."""
    position = np.linspace(0.0, len(signal) - 1.0, count)
    left = np.minimum(position.astype(int), len(signal) - 2)
    fraction = (position - left).reshape(-1, *[1] * (signal.ndim - 1))
    return (1.0 - fraction) * signal[left] + fraction * signal[left + 1]


@cache
def _sections(cutoff: float) -> np.ndarray:
    """Second-order sections of the low-pass, cut-off relative to Nyquist; cached, since design takes 2 ms."""
    from scipy.signal import butter

    return butter(BUTTERWORTH_ORDER, cutoff, output="sos")


def minimum_jerk(s: Fraction) -> Fraction:
    """Fraction of the path at a fraction s of the duration, both in [0, 1] (Flash & Hogan 1985)."""
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def minimum_jerk_rate(s: Fraction) -> Fraction:
    """Derivative of `minimum_jerk` by s."""
    return 30.0 * s**2 * (1.0 - s) ** 2
