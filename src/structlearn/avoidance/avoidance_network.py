"""Avoidance network of IV.8.1 as a coupling model, in stacks: 17 inputs, 20 and 10 ReLU, three outputs.

    z = 2 (s - low) / (high - low) - 1      h_1 = max(0, z W_1 + b_1)      h_2 = max(0, h_1 W_2 + b_2)
    c = clip(mean + scale * (h_2 W_3 + b_3), smallest target, largest target)

The text bounds the outputs by a sigmoid, the author's code by tanh scaled to the target's range. Both
saturate where the coupling is largest, and weight the error of an axis by its extremes, not its variance.
Here outputs are linear in training and then clipped to the range of the training targets.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from scipy.linalg import block_diag

from structlearn.core.artefacts import holding, read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError

Layers = Sequence[np.ndarray]  # one network: (before + 1, after) per layer, with the biases in the last row


@dataclass(frozen=True)
class AvoidanceNetworks:
    """M networks of equal shape, e.g. one per scenario."""

    columns: np.ndarray  # (D,) inputs among the 17 features, the phase (17) and the phase velocity (18)
    input_low: np.ndarray  # (M, D) smallest training inputs, mapped to -1
    input_high: np.ndarray  # (M, D) largest training inputs, mapped to 1; larger than `input_low`
    layers: tuple[np.ndarray, ...]  # (M, before + 1, after) per layer, with the biases in the last row
    output_mean: np.ndarray  # (M, 3) of the training targets
    output_scale: np.ndarray  # (M, 3) standard deviation of the training targets
    output_low: np.ndarray  # (M, 3) smallest training targets
    output_high: np.ndarray  # (M, 3) largest training targets

    def __len__(self) -> int:
        return len(self.input_low)

    def __call__(self, features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
        """Coupling terms (B, 3) in m: by network b for sample b, or by a single network for all samples.

        `features` (B, 17); `phase` (B,) p; `phase_velocity` (B,) u. Raises ValueError: there are several
        networks, but not as many as samples.
        """
        inputs = selected_inputs(features, phase, phase_velocity, self.columns)
        if len(self) not in (1, len(inputs)):
            raise ValueError(f"{len(inputs)} samples for {len(self)} networks")
        inputs = inputs[None] if len(self) == 1 else inputs[:, None]  # (M, samples of each, D)
        span = (self.input_high - self.input_low)[:, None]
        outputs = forward(self.layers, 2.0 * (inputs - self.input_low[:, None]) / span - 1.0)
        coupling = self.output_mean[:, None] + self.output_scale[:, None] * outputs
        return np.clip(coupling, self.output_low[:, None], self.output_high[:, None]).reshape(-1, 3)

    def take(self, index: np.ndarray | Sequence[int]) -> Self:
        """Networks of the given indices (K,), which may repeat."""
        index = np.asarray(index)
        arrays = {name: getattr(self, name)[index] for name in _PER_NETWORK}
        return type(self)(self.columns, layers=tuple(layer[index] for layer in self.layers), **arrays)


def selected_inputs(
    features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray, columns: Sequence[int] | np.ndarray
) -> np.ndarray:
    """Columns (S, D) of the features (S, 17), the phase (S,) and the phase velocity (S,) side by side."""
    return np.column_stack([features, phase, phase_velocity])[:, np.asarray(columns)]


def forward(layers: Layers, inputs: np.ndarray) -> np.ndarray:
    """Scaled outputs (..., S, 3) of scaled inputs (..., S, D); layers may have a leading axis of networks."""
    values = inputs
    for layer in layers[:-1]:
        values = np.maximum(values @ layer[..., :-1, :] + layer[..., -1:, :], 0.0)
    return values @ layers[-1][..., :-1, :] + layers[-1][..., -1:, :]


def averaged(members: Sequence[Layers]) -> list[np.ndarray]:
    """One network that outputs the mean of several of equal shape, with all their nodes side by side."""
    first = np.concatenate([layers[0] for layers in members], axis=1)
    inner = [
        np.vstack([block_diag(*(layer[:-1] for layer in same)), np.hstack([layer[-1:] for layer in same])])
        for same in zip(*(layers[1:-1] for layers in members), strict=True)
    ]
    last = [layers[-1] / len(members) for layers in members]
    summed = np.vstack([*(layer[:-1] for layer in last), np.sum([layer[-1:] for layer in last], axis=0)])
    return [first, *inner, summed]


def input_range(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest (D,) of (S, D) inputs; a constant column gets a range of two about its value."""
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    constant = high <= low
    return np.where(constant, low - 1.0, low), np.where(constant, high + 1.0, high)


def output_scale(target: np.ndarray) -> np.ndarray:
    """Standard deviation (3,) of (S, 3) targets. Raises InputError: an axis is constant."""
    scale = target.std(axis=0)
    if not (scale > 0.0).all():
        raise InputError("the coupling target of an axis is constant: there is nothing to learn")
    return scale


def write_avoidance_networks(networks: Mapping[str, AvoidanceNetworks], path: str | Path) -> None:
    """Publish named stacks, e.g. one per shape, as one safetensors file.

    Tensors are called `<name>.<array>`, layers `<name>.layers.<l>` from 0.
    """
    tensors: dict[str, np.ndarray] = {}
    for name, stack in networks.items():
        tensors |= {f"{name}.{array}": getattr(stack, array) for array in ("columns", *_PER_NETWORK)}
        tensors |= {f"{name}.layers.{place}": layer for place, layer in enumerate(stack.layers)}
    layers = {name: len(stack.layers) for name, stack in networks.items()}
    write_tensors(tensors, path, json.dumps({"avoidance_networks": layers}, sort_keys=True))


def read_avoidance_networks(path: str | Path) -> dict[str, AvoidanceNetworks]:
    """Read the stacks of a file, by name. Raises InputError: it is another file."""
    tensors = read_tensors(path)
    with holding(path, "avoidance networks"):
        layers = json.loads(read_description(path))["avoidance_networks"]
        return {
            name: AvoidanceNetworks(
                layers=tuple(tensors[f"{name}.layers.{place}"] for place in range(count)),
                **{array: tensors[f"{name}.{array}"] for array in ("columns", *_PER_NETWORK)},
            )
            for name, count in layers.items()
        }


_PER_NETWORK = ("input_low", "input_high", "output_mean", "output_scale", "output_low", "output_high")
