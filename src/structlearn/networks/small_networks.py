"""Stacks of small networks that train as one: every tensor has a leading model axis, nothing loops over it.

Samples are the last axis, (M, D, B). So the features of all models lie one after the other and batch
normalisation takes them all in one call; with the samples in the middle it takes twice as long.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional

MOMENTUM = 0.1
"""Of the running mean and variance of batch normalisation."""

VARIANCE_FLOOR = 1e-5
"""Added to the variance in batch normalisation."""


@dataclass(frozen=True)
class StackedLayers:
    """M fully connected networks: tanh in every hidden layer, linear output.

    With batch normalisation before every tanh, its shifts take the place of the hidden layers' biases.

    Attributes:
        weights: (M, after, before) per layer.
        biases: (M, after, 1) per layer.
        scales: (M, nodes) per hidden layer, of batch normalisation; empty without.
        means: (M, nodes) per hidden layer, running; updated in place.
        variances: (M, nodes) per hidden layer, running; updated in place.
    """

    weights: tuple[Tensor, ...]
    biases: tuple[Tensor, ...]
    scales: tuple[Tensor, ...] = ()
    means: tuple[Tensor, ...] = ()
    variances: tuple[Tensor, ...] = ()

    @classmethod
    def initial(cls, models: int, sizes: Sequence[int], generator: torch.Generator, normalised: bool) -> Self:
        """Networks to be trained.

        Args:
            models: number of networks M.
            sizes: number of inputs, nodes of each hidden layer, number of outputs.
            generator: source of the weights, of variance 1 / inputs of their layer.
            normalised: with batch normalisation.
        """
        weights = [
            torch.randn(models, after, before, generator=generator) / before**0.5
            for before, after in pairwise(sizes)
        ]
        biases = [torch.zeros(models, after, 1) for after in sizes[1:]]
        hidden = [(models, size) for size in sizes[1:-1]] if normalised else []
        layers = cls(
            weights=tuple(weights),
            biases=tuple(biases),
            scales=tuple(torch.ones(shape) for shape in hidden),
            means=tuple(torch.zeros(shape) for shape in hidden),
            variances=tuple(torch.ones(shape) for shape in hidden),
        )
        for values in layers.parameters():
            values.requires_grad_()
        return layers

    def parameters(self) -> list[Tensor]:
        """What is trained."""
        return [*self.weights, *self.biases, *self.scales]

    def forward(self, inputs: Tensor, training: bool = False) -> Tensor:
        """Outputs (M, outputs, B) of inputs (M, D, B); batch statistics are used, and kept, in training."""
        return torch.baddbmm(self.biases[-1], self.weights[-1], self.hidden(inputs, training))

    def hidden(self, inputs: Tensor, training: bool = False) -> Tensor:
        """Activations (M, nodes, B) of the last hidden layer."""
        values = inputs
        for place in range(len(self.weights) - 1):
            values = tanh(self._hidden_input(place, values, training))
        return values

    def part(self, models: slice) -> Self:
        """Some of the networks; they share their parameters with these."""
        return type(self)(
            **{name: tuple(values[models] for values in found) for name, found in vars(self).items()}
        )

    def to_arrays(self) -> dict[str, Tensor]:
        """All tensors by field and layer, e.g. `weights.0`."""
        return {
            f"{name}.{place}": values.detach()
            for name, found in vars(self).items()
            for place, values in enumerate(found)
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Tensor]) -> Self:
        """The inverse of `to_arrays`."""
        fields = {}
        for name in cls.__dataclass_fields__:
            count = sum(key.startswith(f"{name}.") for key in arrays)
            fields[name] = tuple(arrays[f"{name}.{place}"] for place in range(count))
        return cls(**fields)

    def _hidden_input(self, place: int, values: Tensor, training: bool) -> Tensor:
        """What goes into the tanh of a hidden layer."""
        weights, biases = self.weights[place], self.biases[place]
        if not self.scales:
            return torch.baddbmm(biases, weights, values)
        values = torch.bmm(weights, values)
        return functional.batch_norm(
            values.reshape(1, -1, values.shape[-1]),
            self.means[place].view(-1),
            self.variances[place].view(-1),
            self.scales[place].flatten(),
            biases.flatten(),
            training,
            MOMENTUM,
            VARIANCE_FLOOR,
        ).view_as(values)


def tanh(values: Tensor) -> Tensor:
    """Hyperbolic tangent as 2 sigmoid(2 x) - 1: torch's own takes twice as long as these three together."""
    return torch.sigmoid(2.0 * values) * 2.0 - 1.0
