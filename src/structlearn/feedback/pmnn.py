"""Phase-modulated neural network: the feedback model of one coupling dimension (eq. IV.27-IV.30).

    h_1 = tanh(W_1 z + b_1), ..., h_L = tanh(W_L h_{L-1} + b_L)        z = (ds - mean) / scale
    m = G(p, u) * (W_m h_L + b_m)                                      G_i = psi_i(p) u / sum_j psi_j(p)
    c = w_c . m

There is no output bias: where the phase velocity u is zero, c is zero, so the adapted movement still starts
smoothly and still ends at its goal, whatever the weights. This module is the reference in numpy and what a
model file holds; `stacked_pmnn` is what is trained, `compiled_pmnn` what a robot runs.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from structlearn.ground.artefacts import read_description, read_tensors, write_tensors
from structlearn.ground.errors import InputError


@dataclass(frozen=True)
class PhaseModulatedNetwork:
    """A trained network; the standardisation of its input belongs to it.

    Attributes:
        input_mean: (D,) mean of the training deviations.
        input_scale: (D,) their std, positive.
        hidden: (weights (H, previous), biases (H,)) of each hidden layer, none for L = 0.
        phase_weights: (N, H) W_m, or (N, D) without a hidden layer.
        phase_biases: (N,) b_m.
        output_weights: (N,) w_c.
    """

    input_mean: np.ndarray
    input_scale: np.ndarray
    hidden: tuple[tuple[np.ndarray, np.ndarray], ...]
    phase_weights: np.ndarray
    phase_biases: np.ndarray
    output_weights: np.ndarray

    @property
    def sizes(self) -> list[int]:
        """Number of inputs, then the width of each hidden layer."""
        return [len(self.input_mean), *(len(biases) for _, biases in self.hidden)]

    def coupling(self, deviation: np.ndarray, modulation: np.ndarray) -> np.ndarray:
        """Coupling term.

        Args:
            deviation: (..., D) sensor deviations ds, in the unit that the network was trained on.
            modulation: (..., N) phase features G(p, u) (`primitives.kernels.features`).

        Returns:
            (...) coupling term c.
        """
        layer = (deviation - self.input_mean) / self.input_scale
        for weights, biases in self.hidden:
            layer = np.tanh(layer @ weights.T + biases)
        return (modulation * (layer @ self.phase_weights.T + self.phase_biases)) @ self.output_weights


def write_networks(networks: Sequence[tuple[str, PhaseModulatedNetwork]], path: str | Path) -> None:
    """Publish named networks, e.g. one per primitive, as one safetensors file.

    Tensors are called `<name>.<array>`; hidden layer l (from 0) is `<name>.hidden.<l>.weights` and `.biases`.
    """
    tensors: dict[str, np.ndarray] = {}
    for name, network in networks:
        tensors |= network_tensors(name, network)
    layers = {name: len(network.hidden) for name, network in networks}
    write_tensors(tensors, path, json.dumps({"phase_modulated_networks": layers}, sort_keys=True))


def read_networks(path: str | Path) -> dict[str, PhaseModulatedNetwork]:
    """Read the networks of a file by name.

    Raises:
        InputError: the file is missing, no safetensors, or holds something else; or a weight is not finite.
    """
    tensors = read_tensors(path)
    try:
        layers = json.loads(read_description(path))["phase_modulated_networks"]
        return {name: named_network(name, count, tensors) for name, count in layers.items()}
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: holds no phase-modulated networks (missing {error})") from error


def dominant_features(network: PhaseModulatedNetwork, count: int = 10) -> np.ndarray:
    """Which hidden nodes weigh most for each phase kernel (figure IV.16 bottom).

    Args:
        network: a trained network.
        count: nodes per kernel.

    Returns:
        (N, H) True for the nodes with the largest |weight| into a kernel.
    """
    order = np.argsort(-np.abs(network.phase_weights), axis=1, kind="stable")
    dominant = np.zeros(network.phase_weights.shape, dtype=bool)
    np.put_along_axis(dominant, order[:, :count], True, axis=1)
    return dominant


_ARRAYS = ("input_mean", "input_scale", "phase_weights", "phase_biases", "output_weights")


def network_tensors(name: str, network: PhaseModulatedNetwork) -> dict[str, np.ndarray]:
    """Arrays of a network, called as `write_networks` says."""
    tensors = {f"{name}.{array}": getattr(network, array) for array in _ARRAYS}
    for layer, (weights, biases) in enumerate(network.hidden):
        tensors |= {f"{name}.hidden.{layer}.weights": weights, f"{name}.hidden.{layer}.biases": biases}
    return tensors


def named_network(name: str, layers: int, tensors: Mapping[str, np.ndarray]) -> PhaseModulatedNetwork:
    """The inverse of `network_tensors` for a number of hidden layers; KeyError where an array is missing."""
    hidden = tuple(
        (tensors[f"{name}.hidden.{layer}.weights"], tensors[f"{name}.hidden.{layer}.biases"])
        for layer in range(layers)
    )
    return PhaseModulatedNetwork(hidden=hidden, **{array: tensors[f"{name}.{array}"] for array in _ARRAYS})
