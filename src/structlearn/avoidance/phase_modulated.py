"""The phase-modulated network of the tactile testbed on obstacle features (named as future work in IV.8).

One network per axis of the coupling term (eq. IV.27-IV.30), trained as one stack on the same draws. Where the
phase rests there is no coupling: such a model needs no post-processing to let a movement reach its goal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from structlearn.avoidance.avoidance_dataset import AXES, AvoidanceDataset
from structlearn.feedback.coupling_dataset import FRACTIONS, CouplingDataset, without_generalization
from structlearn.feedback.coupling_model import (
    CouplingModel,
    TrainingParameters,
    read_networks,
    write_networks,
)
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.ground.errors import InputError


@dataclass(frozen=True)
class PhaseModulatedAvoidance:
    """A coupling model of one network per axis.

    Attributes:
        networks: of x, y and z, with the same number of kernels.
    """

    networks: tuple[CouplingModel, ...]

    def __call__(self, features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
        """Coupling terms (B, 3) in m of features (B, 17), phase (B,) and phase velocity (B,)."""
        return np.stack(
            [network.coupling(features, phase, phase_velocity) for network in self.networks], axis=-1
        )


def train_phase_modulated(
    dataset: AvoidanceDataset, parameters: TrainingParameters, hidden: Sequence[int]
) -> PhaseModulatedAvoidance:
    """Train on all samples but those that say when to stop.

    Args:
        dataset: samples of any number of scenarios.
        parameters: of the training; its chunks of consecutive samples are split together.
        hidden: nodes of the regular hidden layers.

    Raises:
        InputError: too few samples, or the target of an axis is constant.
    """
    per_axis = [coupling_dataset(dataset, axis) for axis in range(len(AXES))]
    fold = without_generalization(per_axis[0], FRACTIONS, parameters.chunk_samples, parameters.seed)
    trained = PhaseModulatedNetwork.train([(one, fold) for one in per_axis], parameters, hidden)
    return PhaseModulatedAvoidance(tuple(one.models["validation"] for one in trained))


def coupling_dataset(dataset: AvoidanceDataset, axis: int) -> CouplingDataset:
    """One axis of the coupling term as the feedback models know it; the scenario is the setting."""
    return CouplingDataset(
        deviation=dataset.features,
        phase=dataset.phase,
        phase_velocity=dataset.phase_velocity,
        target=dataset.target[:, axis],
        setting=dataset.scenario.astype(float),
        demonstration=dataset.demonstration,
        time=dataset.time,
    )


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
