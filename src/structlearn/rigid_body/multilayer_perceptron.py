"""Multilayer perceptrons as models of inverse dynamics, M of them (seeds) as one stack."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import torch
from torch import Tensor

from structlearn.networks.stacked_layers import StackedLayers

SCALING = ("input_mean", "input_scale", "output_mean", "output_scale")
"""Tensors that all models of a stack have in common."""


@dataclass(frozen=True)
class StackedPerceptrons:
    """M networks from (q, qd, qdd) to torques.

    Attributes:
        network: of 3 n inputs and n outputs.
        input_mean: (3 n,) taken off the states.
        input_scale: (3 n,) by which they are divided.
        output_mean: (n,) N m.
        output_scale: (n,) N m.
    """

    network: StackedLayers
    input_mean: Tensor
    input_scale: Tensor
    output_mean: Tensor
    output_scale: Tensor

    @classmethod
    def initial(cls, joints: int, hidden: Sequence[int], generators: Sequence[torch.Generator]) -> Self:
        """Networks to be trained on plain states and torques.

        Args:
            joints: number of joints n.
            hidden: nodes of each hidden layer.
            generators: source of the initial values of each model.
        """
        scaling = [plain(size) for size in (3 * joints, joints) for plain in (torch.zeros, torch.ones)]
        return cls(StackedLayers.uniform((3 * joints, *hidden, joints), generators), *scaling)

    def standardised(self, states: Sequence[Tensor], torque: Tensor) -> Self:
        """The networks that see and give standardised values, which the dissertation's do not.

        Args:
            states: positions, velocities and accelerations (n, N) of the training set.
            torque: (n, N) torques of the training set.
        """
        scaling = (*_mean_and_scale(torch.cat(list(states))), *_mean_and_scale(torque))
        scales: dict[str, Any] = dict(zip(SCALING, scaling, strict=True))
        return replace(self, **scales)

    def parameters(self) -> list[Tensor]:
        """What is trained."""
        return self.network.parameters()

    def torques(self, q: Tensor, qd: Tensor, qdd: Tensor) -> Tensor:
        """Torques (M, n, B) in N m of states (n, B) for all models, or (M, n, B)."""
        inputs = (torch.cat([q, qd, qdd], dim=-2) - self.input_mean[:, None]) / self.input_scale[:, None]
        outputs = self.network.forward(inputs.expand(self.network.models, -1, -1))
        return outputs * self.output_scale[:, None] + self.output_mean[:, None]

    def to_arrays(self) -> dict[str, Tensor]:
        """All tensors by name, e.g. `network.weights.0`, without gradients."""
        return self.network.to_arrays("network.") | {name: getattr(self, name) for name in SCALING}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Tensor]) -> Self:
        """The inverse of `to_arrays`."""
        return cls(StackedLayers.from_arrays(arrays, "network."), *(arrays[name] for name in SCALING))


def _mean_and_scale(values: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and standard deviation (D,) of (D, N); a constant row has the scale 1."""
    scale = values.std(dim=1, correction=0)
    return values.mean(dim=1), torch.where(scale > 0.0, scale, 1.0)
