"""What a sensor's channels mean, as far as a latent space needs to know: its description stands in a file.

A BioTac's electrodes fall under pressure and say by their mean how hard the skin is pressed. Other skins have
signed channels that couple widely: a magnetometer's axis may rise or fall, so their norm tells the pressure
and their direction tells the place. A gain common to all channels, which drifts, changes the norm alone.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters


class SensorDescription(Parameters):
    """A sensor of E channels."""

    channels: tuple[str, ...] = Field(min_length=1)  # names, in the order of the columns
    # (x, y) of each channel on the skin; None: not known, and not needed
    places_mm: tuple[tuple[float, float], ...] | None
    # what pressure does to a reading: all fall, all rise, or each goes its own way
    change: Literal["falls", "rises", "either"]
    by_norm: bool  # whether readings are divided by their norm, whose logarithm then is a channel of its own
    # standard deviation of the logarithm of the gain that all channels share and that drifts
    gain_spread: float = Field(ge=0)

    def seen(self, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signals that a latent space learns from, and the contact pressure.

        Args:
            counts: (N, E) readings less the resting ones.

        Returns:
            signals: (N, E), or (N, E + 1) by norm: unit vectors and the logarithm of the norm.
            pressure: (N,) p = -mean(s) where readings fall (eq. II.1), mean(s) where they rise, else the
                norm; by norm its logarithm.

        Raises:
            InputError: the number of channels is another one, or a row that is divided by its norm is zero.
        """
        if counts.shape[1] != len(self.channels):
            raise InputError(f"sensor: {counts.shape[1]} channels, its description has {len(self.channels)}")
        strength = np.linalg.norm(counts, axis=1)
        pressure = {"falls": -counts.mean(axis=1), "rises": counts.mean(axis=1), "either": strength}[
            self.change
        ]
        if not self.by_norm:
            return counts, pressure
        if not strength.all():
            raise InputError(
                f"sensor: row {int(np.argmin(strength))} is zero in all channels: nothing touches"
            )
        strength = strength[:, None]
        signals = np.hstack([counts / strength, np.log(strength)])
        return signals, signals[:, -1] if self.change == "either" else pressure

    def drifted(self, counts: np.ndarray, copies: int, rng: np.random.Generator) -> np.ndarray:
        """Readings (copies N, E): as they are, then copies of them, each with a gain that drifted."""
        gains = np.exp(self.gain_spread * rng.standard_normal(((copies - 1) * len(counts), 1)))
        return np.vstack([counts, np.tile(counts, (copies - 1, 1)) * gains])
