"""What is chosen for latent spaces, their dynamics and distances on the skin; names of what is compared.

A sensor's description says what its channels mean, as far as a latent space needs to know. A BioTac's
electrodes fall under pressure and say by their mean how hard the skin is pressed. Other skins have signed
channels that couple widely: a magnetometer's axis may rise or fall, so their norm tells the pressure and
their direction tells the place. A gain common to all channels, which drifts, changes the norm alone.
"""

from typing import Final, Literal

import numpy as np
from pydantic import Field, PositiveInt

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters

LATENT = 3  # dimensions of the latent state: map x, map y, pressure
MAP = 2  # of these, the ones of the map
STRUCTURES = (True, False)  # whether the latent space has structure: L_MDS and L_CDP in its loss

InverseModel = Literal["LL", "NG", "NJ"]

LOCALLY_LINEAR: InverseModel = "LL"
NEGATIVE_GRADIENT: InverseModel = "NG"
JACOBIAN: InverseModel = "NJ"  # names of the inverse models
NONLINEAR = "NL"  # name of the other forward model, beside `LOCALLY_LINEAR`
UNCHANGED = "unchanged"  # the prediction that nothing moves, beside the forward models
NO_INVERSE: Final = "none"  # trained with L_LFD alone

TRAINED_WITH: dict[str, tuple[InverseModel | Literal["none"], ...]] = {
    LOCALLY_LINEAR: (NO_INVERSE, LOCALLY_LINEAR),
    NONLINEAR: (NO_INVERSE, NEGATIVE_GRADIENT, JACOBIAN),
}
"""Per forward model, the inverse models whose loss L_ID it is trained with, in the order of its stack."""

FORWARD_OF: dict[InverseModel, str] = {
    LOCALLY_LINEAR: LOCALLY_LINEAR,
    NEGATIVE_GRADIENT: NONLINEAR,
    JACOBIAN: NONLINEAR,
}
"""Per inverse model, the forward model that it shares its parameters with."""


class NetworkParameters(Parameters):
    """Sizes of the networks (II.4.1.3)."""

    encoder_hidden: tuple[PositiveInt, ...]
    locally_linear_hidden: tuple[PositiveInt, ...]
    nonlinear_hidden: PositiveInt


class LossWeights(Parameters):
    """Weights of the losses (eq. II.23, II.24), for quantities in the units of `TouchUnits`."""

    reconstruction: float = Field(ge=0)
    distances: float = Field(ge=0)
    pressure: float = Field(ge=0)
    forward: float = Field(ge=0)
    inverse: float = Field(ge=0)


class LatentTrainingParameters(Parameters):
    """How latent spaces and dynamics are trained."""

    steps: PositiveInt
    batch_size: PositiveInt
    learning_rate: float = Field(gt=0)
    decay: float = Field(gt=0, lt=1)
    weights: LossWeights
    action_penalty: float = Field(gt=0)
    evaluate_every: PositiveInt
    seed: int = Field(ge=0)


class LatentParameters(Parameters):
    """What is trained, and how it is compared."""

    seeds: PositiveInt
    stacks: PositiveInt
    starts: PositiveInt
    start_steps: PositiveInt
    map_unit_m: float = Field(gt=0)
    networks: NetworkParameters
    training: LatentTrainingParameters
    pair_pool: PositiveInt
    evaluation_pairs: PositiveInt
    longest_chain: int = Field(ge=3)


class LatentSpaceParameters(Parameters):
    """How latent spaces are learned from a small set."""

    seeds: PositiveInt
    networks: NetworkParameters
    training: LatentTrainingParameters
    pair_pool: int = Field(ge=1)
    evaluation_pairs: int = Field(ge=1)


class GeodesicParameters(Parameters):
    """The neighbour graph."""

    neighbours: int = Field(ge=2)
    bin_size: int = Field(ge=3)
    bins: int | None = Field(ge=1)
    bridge_mm: float = Field(ge=0)
    seed: int = Field(ge=0)


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

        `counts` (N, E): readings less the resting ones. Returns signals (N, E), or (N, E + 1) by norm: unit
        vectors and the logarithm of the norm; and pressure (N,), p = -mean(s) where readings fall (eq. II.1),
        mean(s) where they rise, else the norm; by norm its logarithm. Raises InputError: the number of
        channels is another one, or a row that is divided by its norm is zero.
        """
        if counts.shape[1] != len(self.channels):
            raise InputError(f"sensor: {counts.shape[1]} channels, its description has {len(self.channels)}")
        strength = np.linalg.norm(counts, axis=1)
        pressures = {"falls": -counts.mean(axis=1), "rises": counts.mean(axis=1), "either": strength}
        pressure = pressures[self.change]
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
