"""Multilayer perceptrons as models of inverse dynamics, M of them (seeds) in batched matrix products."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn


class StackedLayers(nn.Module):
    """Fully connected layers of M independent networks: tanh in between, linear at the end.

    Samples are the last axis, so that what is done entry by entry runs along memory. Weights and biases start
    uniform in +-1 / sqrt(inputs of the layer), torch's own default, as the dissertation's networks do.

    Args:
        sizes: number of inputs, nodes of each hidden layer, number of outputs.
        generators: source of the initial values of each model.
    """

    def __init__(self, sizes: Sequence[int], generators: Sequence[torch.Generator]):
        super().__init__()
        drawn = [
            [
                (2.0 * torch.rand(after, before + 1, generator=generator) - 1.0) / before**0.5
                for before, after in pairwise(sizes)
            ]
            for generator in generators
        ]
        stacked = [torch.stack(layers) for layers in zip(*drawn, strict=True)]
        self.weights = nn.ParameterList(layer[..., :-1].clone() for layer in stacked)
        self.biases = nn.ParameterList(layer[..., -1:].clone() for layer in stacked)

    @property
    def models(self) -> int:
        """M."""
        return len(self.weights[0])

    def layers(self) -> list[tuple[Tensor, Tensor]]:
        """Weights (M, next, previous) and biases (M, next, 1) of each layer."""
        return list(zip(self.weights, self.biases, strict=True))

    def activations(self, inputs: Tensor) -> list[Tensor]:
        """Values (M, nodes, B) of each hidden layer at inputs (M, D, B)."""
        values = []
        for weights, biases in self.layers()[:-1]:
            # tanh(x) = 2 sigmoid(2 x) - 1: torch's tanh takes seven times as long
            inputs = 2.0 * torch.sigmoid(torch.baddbmm(biases, weights, inputs, beta=2.0, alpha=2.0)) - 1.0
            values.append(inputs)
        return values

    def output(self, last: Tensor) -> Tensor:
        """Outputs (M, K, B) of the last hidden layer's values."""
        return torch.baddbmm(self.biases[-1], self.weights[-1], last)


class StackedPerceptrons(nn.Module):
    """M networks from (q, qd, qdd) to torques.

    Args:
        joints: number of joints n.
        hidden: nodes of each hidden layer.
        generators: source of the initial values of each model.
    """

    def __init__(self, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]):
        super().__init__()
        self.network = StackedLayers((3 * joints, *hidden, joints), generators)
        self.register_buffer("input_mean", torch.zeros(3 * joints))
        self.register_buffer("input_scale", torch.ones(3 * joints))
        self.register_buffer("output_mean", torch.zeros(joints))
        self.register_buffer("output_scale", torch.ones(joints))

    def standardise(self, states: Sequence[Tensor], torque: Tensor) -> None:
        """Let the networks see and give standardised values, which the dissertation's do not.

        Args:
            states: positions, velocities and accelerations (n, N) of the training set.
            torque: (n, N) torques of the training set.
        """
        self.input_mean, self.input_scale = _mean_and_scale(torch.cat(list(states)))
        self.output_mean, self.output_scale = _mean_and_scale(torque)

    def forward(self, q: Tensor, qd: Tensor, qdd: Tensor) -> Tensor:
        """Torques (M, n, B) in N m of states (n, B), the same states for all models."""
        inputs = (torch.cat([q, qd, qdd]) - self.input_mean[:, None]) / self.input_scale[:, None]
        last = self.network.activations(inputs.expand(self.network.models, -1, -1))[-1]
        return self.network.output(last) * self.output_scale[:, None] + self.output_mean[:, None]


def _mean_and_scale(values: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (D,) of (D, N); a constant row has the scale 1."""
    scale = values.std(dim=1, correction=0)
    return values.mean(dim=1), torch.where(scale > 0.0, scale, 1.0)
