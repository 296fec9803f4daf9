"""Stacks of networks that train as one: M independent models (folds, seeds) in batched matrix products.

A feedback model is small (38-100-25-1): alone it spends its training in the overhead of its own steps. Here
every parameter has a leading model axis, so one step of all folds costs hardly more calls than a step of one.
The models share nothing but the dropout masks; a model learns the same alone and in a stack.

    h_1 = tanh(z W_1 + b_1), ...        m = G(p, u) * k * (h_L W_m + b_m)        c = m . w_c

The fixed factors k_i = 1 / |mean of u under kernel i| are what `pmnn.PhaseModulatedNetwork` lacks. They
change no function that can be learnt: u is -4.6 in mid-movement and -0.15 at its end, where a correction must
still be held, and with them a late kernel's weights need not grow 30 times as large as the others on
gradients 30 times as small. RMSProp divides each gradient by its own size and so makes up for most of that;
initial outputs and optimisers of another kind do not. `to_network` folds the factors into the phase weights.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn

from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.primitives import canonical
from structlearn.primitives.kernels import features

MOVEMENT_SAMPLES = 1000
"""Samples of one movement over which the mean phase velocity of a kernel is taken."""


class StackedPhaseModulatedNetworks(nn.Module):
    """M phase-modulated networks (eq. IV.27-IV.30): no output bias, c = 0 wherever u = 0.

    Args:
        models: number of networks M.
        inputs: number of inputs D.
        hidden: nodes of each regular hidden layer; empty for a network without.
        kernels: number of phase kernels N.
        dropout: probability with which a node of a regular hidden layer is left out of a training step.
        generator: source of the initial weights and of the dropout masks.
    """

    def __init__(
        self,
        models: int,
        inputs: int,
        hidden: Sequence[int],
        kernels: int,
        dropout: float,
        generator: torch.Generator,
    ):
        super().__init__()
        self.hidden = HiddenLayers(models, (inputs, *hidden), dropout, generator)
        last = (inputs, *hidden)[-1]
        self.phase_weights = nn.Parameter(initial_weights(models, last, kernels, generator))
        self.phase_biases = nn.Parameter(torch.zeros(models, 1, kernels))
        self.output_weights = nn.Parameter(initial_weights(models, kernels, 1, generator))
        self.register_buffer("kernel_scale", torch.tensor(kernel_scale(kernels), dtype=torch.float32))

    def forward(self, inputs: Tensor, modulation: Tensor) -> Tensor:
        """Coupling terms in units of the target's scale.

        Args:
            inputs: (M, B, D) standardised deviations.
            modulation: (M, B, N) phase features G(p, u) (`primitives.kernels.features`).

        Returns:
            (M, B) coupling terms.
        """
        units = torch.baddbmm(self.phase_biases, self.hidden(inputs), self.phase_weights)
        scaled = self.output_weights * self.kernel_scale[:, None]  # (M, N, 1): scaling G would cost more
        return torch.bmm(modulation * units, scaled).squeeze(-1)

    def to_network(
        self, index: int, input_mean: np.ndarray, input_scale: np.ndarray, output_scale: float
    ) -> PhaseModulatedNetwork:
        """One model of the stack as what a file holds, in float64.

        Args:
            index: which model.
            input_mean: (D,) mean that was taken off its inputs.
            input_scale: (D,) positive scale by which they were divided.
            output_scale: scale by which its targets were divided.
        """
        scale = kernel_scale(len(self.kernel_scale))
        return PhaseModulatedNetwork(
            input_mean=np.array(input_mean, dtype=float),
            input_scale=np.array(input_scale, dtype=float),
            hidden=tuple(
                (_array(weights[index]).T, _array(biases[index, 0]))
                for weights, biases in self.hidden.layers()
            ),
            phase_weights=_array(self.phase_weights[index]).T * scale[:, None],
            phase_biases=_array(self.phase_biases[index, 0]) * scale,
            output_weights=_array(self.output_weights[index, :, 0]) * output_scale,
        )

    @classmethod
    def from_networks(
        cls,
        networks: Sequence[PhaseModulatedNetwork],
        output_scales: Sequence[float],
        dropout: float,
        generator: torch.Generator,
    ) -> Self:
        """A stack that starts from given networks of equal shape; the inverse of `to_network`.

        Args:
            networks: one per model; their standardisation of inputs stays with the caller.
            output_scales: (M,) scales by which each model's targets are divided.
            dropout: as for a new stack.
            generator: source of the dropout masks.
        """
        first = networks[0]
        sizes = tuple(len(biases) for _, biases in first.hidden)
        count, inputs = len(first.phase_biases), len(first.input_mean)
        stack = cls(len(networks), inputs, sizes, count, dropout, generator)
        scale = kernel_scale(count)
        with torch.no_grad():
            for index, (network, output_scale) in enumerate(zip(networks, output_scales, strict=True)):
                for (weights, biases), (found_weights, found_biases) in zip(
                    stack.hidden.layers(), network.hidden, strict=True
                ):
                    weights[index] = torch.tensor(found_weights.T)
                    biases[index, 0] = torch.tensor(found_biases)
                stack.phase_weights[index] = torch.tensor(network.phase_weights.T / scale)
                stack.phase_biases[index, 0] = torch.tensor(network.phase_biases / scale)
                stack.output_weights[index, :, 0] = torch.tensor(network.output_weights / output_scale)
        return stack


class StackedFeedForwardNetworks(nn.Module):
    """M ordinary networks with tanh and dropout in every hidden layer and a biased linear output.

    With two hidden layers of 100 and 25 this is the phase-modulated network with its modulation taken away:
    the dissertation's rival, on ds or on [ds, p, u].

    Args:
        models: number of networks M.
        inputs: number of inputs D.
        hidden: nodes of each hidden layer.
        dropout: probability with which a hidden node is left out of a training step.
        generator: source of the initial weights and of the dropout masks.
    """

    def __init__(
        self, models: int, inputs: int, hidden: Sequence[int], dropout: float, generator: torch.Generator
    ):
        super().__init__()
        self.hidden = HiddenLayers(models, (inputs, *hidden), dropout, generator)
        self.output_weights = nn.Parameter(initial_weights(models, (inputs, *hidden)[-1], 1, generator))
        self.output_biases = nn.Parameter(torch.zeros(models, 1, 1))

    def forward(self, inputs: Tensor, modulation: Tensor | None = None) -> Tensor:
        """Coupling terms (M, B) of standardised inputs (M, B, D); there is no modulation to use."""
        return torch.baddbmm(self.output_biases, self.hidden(inputs), self.output_weights).squeeze(-1)


class HiddenLayers(nn.Module):
    """Regular hidden layers of a stack: tanh, then dropout.

    Args:
        models: number of networks M.
        sizes: number of inputs, then the nodes of each layer.
        dropout: probability with which a node is left out of a training step.
        generator: source of the initial weights and of the dropout masks.
    """

    def __init__(self, models: int, sizes: Sequence[int], dropout: float, generator: torch.Generator):
        super().__init__()
        pairs = list(pairwise(sizes))
        self.weights = nn.ParameterList(
            initial_weights(models, before, after, generator) for before, after in pairs
        )
        self.biases = nn.ParameterList(torch.zeros(models, 1, after) for _, after in pairs)
        self.dropout = dropout
        self.generator = generator

    def layers(self) -> list[tuple[Tensor, Tensor]]:
        """Weights (M, previous, H) and biases (M, 1, H) of each layer."""
        return list(zip(self.weights, self.biases, strict=True))

    def forward(self, inputs: Tensor) -> Tensor:
        """(M, B, D) -> (M, B, H)."""
        values = inputs
        for weights, biases in self.layers():
            # tanh(x) = 2 (sigmoid(2 x) - 1/2): torch's tanh takes nine times as long, a quarter of a step
            halved = torch.sigmoid(torch.baddbmm(biases, values, weights, beta=2.0, alpha=2.0)) - 0.5
            dropping = self.training and self.dropout > 0.0
            values = halved * (2.0 * self._mask(halved.shape[1:]) if dropping else 2.0)
        return values

    def _mask(self, shape: Sequence[int]) -> Tensor:
        """Dropout mask (B, H) for all models: a model's mask must not depend on who else is in the stack.

        Its values are 0 and 1 / keep, so the expected activation is the one without dropout.
        """
        kept = torch.rand(*shape, generator=self.generator) >= self.dropout
        return kept.float().div_(1.0 - self.dropout)


def kernel_scale(count: int) -> np.ndarray:
    """Factors k_i = 1 / |mean of u under kernel i| over one movement, (N,)."""
    p, u = canonical.phase(np.linspace(0.0, 1.0, MOVEMENT_SAMPLES), canonical.TAU_PER_DURATION)
    normalised = features(p, np.ones_like(p), count)  # (T, N) psi_i / sum_j psi_j
    return normalised.sum(axis=0) / np.abs(u @ normalised)


def initial_weights(models: int, before: int, after: int, generator: torch.Generator) -> Tensor:
    """(M, before, after) weights of variance 1 / before: activations keep their size from layer to layer."""
    return torch.randn(models, before, after, generator=generator) / before**0.5


def _array(values: Tensor) -> np.ndarray:
    return values.detach().numpy().astype(float)
