"""Latent space of touch: autoencoders whose code is a flat map of the skin and the pressure (II.3.2, II.3.3).

    z = enc(s):   z_xy distances in the map are geodesic distances on the skin,   z_z is the contact pressure

All quantities are in the units of `units.TouchUnits`, so that the three losses are of comparable size.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from structlearn.networks.stacked_layers import StackedLayers

LATENT = 3
"""Dimensions of the latent state: map x, map y, pressure."""

MAP = 2
"""Of these, the ones of the map."""

SQUARED_DISTANCE_FLOOR = 1e-9
"""Keeps the gradient of a distance finite where two points coincide."""


@dataclass(frozen=True)
class StackedAutoencoders:
    """M autoencoders with batch normalisation (II.4.1.3)."""

    encoder: StackedLayers  # (M, E, B) signals -> (M, 3, B) latent states
    decoder: StackedLayers  # the way back

    @classmethod
    def initial(cls, models: int, electrodes: int, hidden: Sequence[int], generator: torch.Generator) -> Self:
        """Autoencoders to be trained.

        `models`: number of autoencoders M; `electrodes`: number of signals E; `hidden`: nodes of the
        encoder's hidden layers; the decoder mirrors them.
        """
        return cls(
            StackedLayers.initial(models, (electrodes, *hidden, LATENT), generator, normalised=True),
            StackedLayers.initial(models, (LATENT, *hidden[::-1], electrodes), generator, normalised=True),
        )

    def parameters(self) -> list[Tensor]:
        """What is trained."""
        return self.encoder.parameters() + self.decoder.parameters()


@dataclass(frozen=True)
class LatentLosses:
    """The three losses of a batch, meant over its samples, per model (M,)."""

    reconstruction: Tensor  # L_AER (eq. II.5), meant over electrodes too
    distances: Tensor  # L_MDS (eq. II.3)
    pressure: Tensor  # L_CDP (eq. II.4)


def latent_losses(
    autoencoders: StackedAutoencoders, signals: Tensor, pressure: Tensor, geodesic: Tensor
) -> LatentLosses:
    """Losses of a batch of pairs, for training.

    `signals` (M, E, 2 B) the pairs' first samples, then their second ones; `pressure` (M, 2 B) their contact
    pressures; `geodesic` (M, B) distance on the skin between the two of a pair.
    """
    latent = autoencoders.encoder.forward(signals, training=True)
    decoded = autoencoders.decoder.forward(latent, training=True)
    return LatentLosses(
        reconstruction=(decoded - signals).square().mean(dim=(1, 2)),
        distances=(map_distance(*latent.chunk(2, dim=-1)) - geodesic).square().mean(dim=1),
        pressure=(latent[:, MAP] - pressure).square().mean(dim=1),
    )


def map_distance(first: Tensor, second: Tensor) -> Tensor:
    """Distance (M, B) in the flat map between latent states (M, 3, B)."""
    squared = (first[:, :MAP] - second[:, :MAP]).square().sum(dim=1)
    return (squared + SQUARED_DISTANCE_FLOOR).sqrt()
