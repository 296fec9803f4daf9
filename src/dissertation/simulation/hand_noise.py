"""Noise of a human hand: slow sway, signal-dependent motor noise and tremor, each in its frequency band."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfftfreq

# shares of the variance of `noise_mm`, and frequency bands
SWAY_SHARE, SWAY_HZ = 0.70, (0.1, 1.0)  # slow postural drift, most of the error in holding still
MOTOR_SHARE, MOTOR_HZ = 0.17, (1.0, 6.0)  # signal-dependent (Harris & Wolpert 1998): grows with speed
TREMOR_SHARE, TREMOR_HZ = 0.13, (8.0, 12.0)  # physiological tremor, 0.05-0.2 mm rms in hand-held tools
# (Riviere et al. 1997 and later microsurgery literature): 0.11 mm at the default `noise_mm`
HAND_WIDTH_M = 0.06  # noise at two grips this far apart rotates the tool: rad = m / HAND_WIDTH_M
BOARD_HOLDS = 0.3  # share of the noise along z that remains while the board supports the tool


def hand_noise(
    velocity: np.ndarray, contact: np.ndarray, noise_mm: float, rate_hz: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Noise of a hand that holds and moves a tool: position (T, 3) m, rotation vectors (T, 3) rad.

    `velocity` (T, 3) m/s of the intended movement; `contact` (T,): 0 in the air, 1 with the tool on the
    board, which supports it along z. Both outputs are proportional to `noise_mm`; the draws do not depend on
    it.
    """
    speed = np.linalg.norm(velocity, axis=1)
    envelope = speed / np.sqrt(np.mean(speed**2))  # unit power over the trial
    sway, motor, tremor = (
        _band_noise(len(speed), rate_hz, band, rng) for band in (SWAY_HZ, MOTOR_HZ, TREMOR_HZ)
    )  # (T, 6) each: x, y, z and the rotations about them
    unit = (
        np.sqrt(SWAY_SHARE) * sway
        + np.sqrt(MOTOR_SHARE) * envelope[:, None] * motor
        + np.sqrt(TREMOR_SHARE) * tremor
    )
    metres = 1e-3 * noise_mm * unit
    metres[:, 2] *= 1 + (BOARD_HOLDS - 1) * contact
    return metres[:, :3], metres[:, 3:] / HAND_WIDTH_M


def _band_noise(
    length: int, rate_hz: float, band: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Six independent Gaussian processes (length, 6) with unit std and all power in one band."""
    padded = next_fast_len(2 * length, real=True)  # twice as long, so that the ends do not wrap around
    frequency = rfftfreq(padded, 1 / rate_hz)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    spectrum = np.zeros((len(frequency), 6), dtype=complex)
    spectrum[inside] = rng.standard_normal((inside.sum(), 6)) + 1j * rng.standard_normal((inside.sum(), 6))
    signal = irfft(spectrum, padded, axis=0)[:length]
    return signal / np.sqrt(np.mean(signal**2, axis=0))
