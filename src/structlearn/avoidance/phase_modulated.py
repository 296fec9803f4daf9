"""The phase-modulated network of the tactile testbed on obstacle features (named as future work in IV.8).

One network per axis of the coupling term (eq. IV.27-IV.30), trained as one stack on the same draws. Where the
phase rests there is no coupling: such a model needs no post-processing to let a movement reach its goal.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from structlearn.avoidance.avoidance_dataset import AXES
from structlearn.feedback.pmnn import PhaseModulatedNetwork, read_networks, write_networks
from structlearn.ground.errors import InputError
from structlearn.primitives import kernels


@dataclass(frozen=True)
class PhaseModulatedAvoidance:
    """A coupling model of one network per axis.

    Attributes:
        networks: of x, y and z, with the same number of kernels.
    """

    networks: tuple[PhaseModulatedNetwork, ...]

    def __call__(self, features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
        """Coupling terms (B, 3) in m of features (B, 17), phase (B,) and phase velocity (B,)."""
        modulation = kernels.features(phase, phase_velocity, len(self.networks[0].phase_biases))
        return np.stack([network.coupling(features, modulation) for network in self.networks], axis=-1)


def write_phase_modulated(models: Mapping[str, PhaseModulatedAvoidance], path: str | Path) -> None:
    """Publish named models as one safetensors file; its networks are called `<name>.<axis>`."""
    networks = [
        (f"{name}.{axis}", network)
        for name, model in models.items()
        for axis, network in zip(AXES, model.networks, strict=True)
    ]
    write_networks(networks, path)


def read_phase_modulated(path: str | Path) -> dict[str, PhaseModulatedAvoidance]:
    """Read the models of a file by name, in alphabetical order.

    Raises:
        InputError: the file is missing, no safetensors, or a model lacks an axis.
    """
    networks = read_networks(path)
    names = sorted({name.rpartition(".")[0] for name in networks})
    if set(networks) != {f"{name}.{axis}" for name in names for axis in AXES}:
        raise InputError(f"{path}: an avoidance model has one network for each of x, y and z")
    return {
        name: PhaseModulatedAvoidance(tuple(networks[f"{name}.{axis}"] for axis in AXES)) for name in names
    }
