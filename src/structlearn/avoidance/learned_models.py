"""Files of the four kinds of avoidance models, and phase-modulated networks on obstacle features.

Phase-modulated networks on obstacle features are named as future work in IV.8: one network per axis of the
coupling term (eq. IV.27-IV.30), trained as one stack on the same batches. The coupling term vanishes with the
phase velocity, so such a model reaches the goal without post-processing.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.avoidance.avoidance_dataset import AXES, AvoidanceDataset
from structlearn.avoidance.avoidance_network import read_avoidance_networks, write_avoidance_networks
from structlearn.avoidance.rai_2014 import read_human_inspired, write_human_inspired
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import CouplingDataset, without_generalization
from structlearn.feedback.coupling_model import CouplingModel as AxisModel
from structlearn.feedback.coupling_model import read_networks, write_networks
from structlearn.feedback.trainers import TrainingParameters

NETWORK, ENSEMBLE = "network", "ensemble"

HUMAN_INSPIRED, PHASE_MODULATED = "human_inspired", "phase_modulated"
"""Kinds of models, also the names of their files and in tables."""

SETTING, ALL = "setting", "all"
"""Training sets other than all scenarios of a shape: a single scenario, or all of them."""


@dataclass(frozen=True)
class PhaseModulatedAvoidance:
    """A coupling model of one network per axis."""

    networks: tuple[AxisModel, ...]  # for x, y and z, with equal numbers of kernels

    def __call__(self, features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
        """Coupling terms (B, 3) in m of features (B, 17), phase (B,) and phase velocity (B,)."""
        terms = [network.coupling(features, phase, phase_velocity) for network in self.networks]
        return np.stack(terms, axis=-1)


def train_phase_modulated(
    dataset: AvoidanceDataset, parameters: TrainingParameters, hidden: Sequence[int]
) -> PhaseModulatedAvoidance:
    """Train on all samples except those for early stopping; consecutive samples are split in chunks.

    Raises InputError: too few samples, or the target of an axis is constant.
    """
    from structlearn.feedback.training import pmnn  # torch

    per_axis = [
        CouplingDataset(
            deviation=dataset.features,
            phase=dataset.phase,
            phase_velocity=dataset.phase_velocity,
            target=target,
            setting=dataset.scenario.astype(float),
            demonstration=dataset.demonstration,
            time=dataset.time,
        )
        for target in dataset.target.T
    ]
    fold = without_generalization(per_axis[0], parameters.chunk_samples, parameters.seed)
    trained = pmnn.train([(samples, fold) for samples in per_axis], parameters, hidden)
    return PhaseModulatedAvoidance(tuple(result.models["validation"] for result in trained))


def write_phase_modulated(models: Mapping[str, PhaseModulatedAvoidance], path: str | Path) -> None:
    """Publish named models as one safetensors file; networks are called `<name>.<axis>`."""
    networks = [
        (f"{name}.{axis}", network)
        for name, model in models.items()
        for axis, network in zip(AXES, model.networks, strict=True)
    ]
    write_networks(networks, path)


def read_phase_modulated(path: str | Path) -> dict[str, PhaseModulatedAvoidance]:
    """Read the models of a file, by name. Raises InputError: an axis is missing."""
    networks = read_networks(path)
    names = sorted({name.rpartition(".")[0] for name in networks})
    if set(networks) != {f"{name}.{axis}" for name in names for axis in AXES}:
        raise InputError(f"{path}: an avoidance model has one network for each of x, y and z")
    return {
        name: PhaseModulatedAvoidance(tuple(networks[f"{name}.{axis}"] for axis in AXES)) for name in names
    }


AvoidanceModels = Mapping[str, Mapping[str, Any]]
"""Coupling models of one person by kind, then by training set: a shape, `all`, or `setting`, a stack with one
model per scenario. Phase-modulated networks may be missing."""

FORMATS: dict[str, tuple[Callable[..., dict[str, Any]], Callable[..., None]]] = {
    NETWORK: (read_avoidance_networks, write_avoidance_networks),
    ENSEMBLE: (read_avoidance_networks, write_avoidance_networks),
    HUMAN_INSPIRED: (read_human_inspired, write_human_inspired),
    PHASE_MODULATED: (read_phase_modulated, write_phase_modulated),
}
"""Reader and writer of each kind of model."""


def write_avoidance_models(models: AvoidanceModels, folder: str | Path) -> None:
    """Write one safetensors file per kind of model into a folder."""
    for kind, (_, write) in FORMATS.items():
        if kind != PHASE_MODULATED or models.get(kind):
            write(models.get(kind, {}), Path(folder, f"{kind}.safetensors"))


def read_avoidance_models(folder: str | Path) -> AvoidanceModels:
    """Read models of `write_avoidance_models`. Raises InputError: a file is missing or another file."""
    files = {kind: Path(folder, f"{kind}.safetensors") for kind in FORMATS}
    wanted = [kind for kind, file in files.items() if kind != PHASE_MODULATED or file.exists()]
    return {kind: FORMATS[kind][0](files[kind]) for kind in wanted}
