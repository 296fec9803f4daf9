"""Latent spaces with and without structure, and their dynamics: stacks of networks and their files.

A stack holds all models of some seeds. Its autoencoders are ordered by structure, then by seed. The models of
each kind of dynamics are ordered by the way they are trained, then as the autoencoders. A file also holds the
units of the networks.

The autoencoders' code is a flat map of the skin and the pressure (II.3.2, II.3.3):

    z = enc(s):   z_xy distances in the map are geodesic distances on the skin,   z_z is the contact pressure

All quantities are in the units of `TouchUnits`, so that the three losses are of comparable size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from structlearn.core.artefacts import read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.networks.stacked_layers import StackedLayers
from structlearn.networks.torch_settings import square_root
from structlearn.tactile.latent_dynamics import (
    ACTION,
    ForwardDynamics,
    LocallyLinearDynamics,
    NonLinearDynamics,
)
from structlearn.tactile.latent_parameters import (
    LATENT,
    LOCALLY_LINEAR,
    MAP,
    NONLINEAR,
    STRUCTURES,
    TRAINED_WITH,
    LatentNetworkParameters,
)
from structlearn.tactile.touch_dataset import TouchUnits

SQUARED_DISTANCE_FLOOR = 1e-9  # keeps the gradient of a distance finite where two points coincide

NETWORKS = ("encoder", "decoder", "locally_linear", "nonlinear")  # names of a stack's networks in files
SEEDS = "seeds"
UNITS = "units."


@dataclass(frozen=True)
class StackedAutoencoders:
    """M autoencoders with batch normalisation (II.4.1.3)."""

    encoder: StackedLayers  # (M, E, B) signals -> (M, 3, B) latent states
    decoder: StackedLayers  # (M, 3, B) latent states -> (M, E, B) signals

    @classmethod
    def initial(cls, models: int, electrodes: int, hidden: Sequence[int], generator: torch.Generator) -> Self:
        """Untrained autoencoders of E signals; the decoder mirrors the encoder's `hidden` layers."""
        return cls(
            StackedLayers.initial(models, (electrodes, *hidden, LATENT), generator, normalised=True),
            StackedLayers.initial(models, (LATENT, *hidden[::-1], electrodes), generator, normalised=True),
        )

    def parameters(self) -> list[Tensor]:
        """Trained parameters."""
        return self.encoder.parameters() + self.decoder.parameters()


@dataclass(frozen=True)
class LatentLosses:
    """The three losses of a batch per model (M,), averaged over its samples."""

    reconstruction: Tensor  # L_AER (eq. II.5), mean over electrodes too
    distances: Tensor  # L_MDS (eq. II.3)
    pressure: Tensor  # L_CDP (eq. II.4)


def latent_losses(
    autoencoders: StackedAutoencoders, signals: Tensor, pressure: Tensor, geodesic: Tensor
) -> LatentLosses:
    """Losses of a batch of pairs, for training.

    `signals` (M, E, 2 B): first samples of the pairs, then second ones; `pressure` (M, 2 B), likewise;
    `geodesic` (M, B): distances of the pairs on the skin.
    """
    latent = autoencoders.encoder.forward(signals, training=True)
    decoded = autoencoders.decoder.forward(latent, training=True)
    return LatentLosses(
        reconstruction=(decoded - signals).square().mean(dim=(1, 2)),
        distances=(map_distance(*latent.chunk(2, dim=-1)) - geodesic).square().mean(dim=1),
        pressure=(latent[:, MAP] - pressure).square().mean(dim=1),
    )


def map_distance(first: Tensor, second: Tensor) -> Tensor:
    """Distance (M, B) in the flat map between latent states (M, 3, B) (eq. II.2)."""
    squared = (first[:, :MAP] - second[:, :MAP]).square().sum(dim=1)
    return square_root(squared + SQUARED_DISTANCE_FLOOR)


@dataclass(frozen=True)
class LatentModels:
    """A stack of latent spaces and their dynamics."""

    seeds: tuple[int, ...]  # S seeds; there are M = 2 S autoencoders
    autoencoders: StackedAutoencoders  # (M)
    locally_linear: LocallyLinearDynamics  # (2 M) models
    nonlinear: NonLinearDynamics  # (3 M) models

    @classmethod
    def initial(
        cls,
        seeds: Sequence[int],
        electrodes: int,
        parameters: LatentNetworkParameters,
        generator: torch.Generator,
        actions: int = ACTION,
    ) -> Self:
        """Untrained models for E channels and actions with K components."""
        count = len(STRUCTURES) * len(seeds)
        linear, nonlinear = (count * len(TRAINED_WITH[name]) for name in (LOCALLY_LINEAR, NONLINEAR))
        return cls(
            seeds=tuple(seeds),
            autoencoders=StackedAutoencoders.initial(count, electrodes, parameters.encoder_hidden, generator),
            locally_linear=LocallyLinearDynamics.initial(
                linear, parameters.locally_linear_hidden, generator, actions
            ),
            nonlinear=NonLinearDynamics.initial(nonlinear, parameters.nonlinear_hidden, generator, actions),
        )

    @classmethod
    def joined(cls, stacks: Sequence[Self]) -> Self:
        """One trainable stack with the seeds of several."""
        arrays = [stack.to_arrays() for stack in stacks]
        shapes = [(-1, len(stack.seeds)) for stack in stacks]
        joined = {}
        for name in arrays[0]:
            by_seed = [part[name].unflatten(0, shape) for part, shape in zip(arrays, shapes, strict=True)]
            joined[name] = torch.cat(by_seed, dim=1).flatten(0, 1)
        models = cls.from_arrays(sum((stack.seeds for stack in stacks), ()), joined)
        for values in (*models.autoencoders.parameters(), *models.dynamics_parameters()):
            values.requires_grad_()
        return models

    @classmethod
    def from_arrays(cls, seeds: Sequence[int], arrays: Mapping[str, Tensor]) -> Self:
        """The inverse of `to_arrays`. Raises KeyError: an array is missing."""
        encoder, decoder, *dynamics = (StackedLayers.from_arrays(arrays, f"{name}.") for name in NETWORKS)
        return cls(
            seeds=tuple(seeds),
            autoencoders=StackedAutoencoders(encoder, decoder),
            locally_linear=LocallyLinearDynamics(dynamics[0]),
            nonlinear=NonLinearDynamics(dynamics[1]),
        )

    def to_arrays(self) -> dict[str, Tensor]:
        """All tensors by network, field and layer, e.g. `encoder.weights.0`; without gradients."""
        spaces, dynamics = self.autoencoders, (self.locally_linear.network, self.nonlinear.network)
        arrays: dict[str, Tensor] = {}
        for name, network in zip(NETWORKS, (spaces.encoder, spaces.decoder, *dynamics), strict=True):
            arrays |= network.to_arrays(f"{name}.")
        return arrays

    def detached(self) -> Self:
        """The same models without gradients."""
        return self.from_arrays(self.seeds, self.to_arrays())

    def __len__(self) -> int:
        """Number of autoencoders M."""
        return len(STRUCTURES) * len(self.seeds)

    def keys(self) -> list[tuple[bool, int]]:
        """Structure and seed of each of the M autoencoders."""
        return [(structure, seed) for structure in STRUCTURES for seed in self.seeds]

    def structured(self) -> Tensor:
        """(M,) 1 for latent spaces with structure, 0 for others."""
        return torch.tensor([float(structure) for structure, _ in self.keys()])

    def for_all(self, values: Tensor) -> Tensor:
        """Values (S, ...) per seed, repeated for every structure (M, ...)."""
        return values.repeat(len(STRUCTURES), *([1] * (values.dim() - 1)))

    def forward_stack(self, forward: str) -> ForwardDynamics:
        """All models of `LOCALLY_LINEAR` or `NONLINEAR` dynamics."""
        return self.locally_linear if forward == LOCALLY_LINEAR else self.nonlinear

    def dynamics(self, forward: str, trained_with: str) -> ForwardDynamics:
        """M forward models of one kind, trained in one way."""
        first = TRAINED_WITH[forward].index(trained_with) * len(self)
        return self.forward_stack(forward).part(slice(first, first + len(self)))

    def dynamics_parameters(self) -> list[Tensor]:
        """Parameters trained by the second optimiser."""
        return self.locally_linear.network.parameters() + self.nonlinear.network.parameters()


class TrainedTouch(NamedTuple):
    """Trained models of S seeds, and the units of their inputs; dynamics may be untrained."""

    models: LatentModels
    units: TouchUnits


def write_latent_models(models: LatentModels, units: TouchUnits, path: str | Path) -> None:
    """Publish a stack of models and their units."""
    arrays = {name: values.numpy() for name, values in models.to_arrays().items()}
    arrays |= {f"{UNITS}{name}": np.asarray(values) for name, values in vars(units).items()}
    arrays[SEEDS] = np.array(models.seeds)
    write_tensors(
        arrays, path, "latent spaces of touch and their dynamics; structlearn.tactile.latent_models"
    )


def read_latent_models(path: str | Path) -> TrainedTouch:
    """Read a stack of models and their units.

    Raises InputError: the file is missing, damaged or another file.
    """
    arrays = read_tensors(path)
    try:
        units = TouchUnits(**{field.name: arrays.pop(UNITS + field.name) for field in fields(TouchUnits)})
        seeds = arrays.pop(SEEDS).tolist()
        tensors = {name: torch.from_numpy(values) for name, values in arrays.items()}
        return TrainedTouch(LatentModels.from_arrays(seeds, tensors), units)
    except KeyError as error:
        raise InputError(f"{path}: holds no latent spaces of touch (missing {error})") from error
