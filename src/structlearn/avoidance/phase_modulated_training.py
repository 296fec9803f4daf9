"""Training of the phase-modulated network on obstacle features, one network per axis as one stack."""

from collections.abc import Sequence

import numpy as np

from structlearn.avoidance.avoidance_dataset import AXES, AvoidanceDataset
from structlearn.avoidance.phase_modulated import PhaseModulatedAvoidance
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.folds import without_generalization
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks
from structlearn.feedback.supervised_training import (
    FRACTIONS,
    StackedData,
    standardisation,
    target_scale,
    train,
)
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.networks.torch_settings import as_tensor, seeded


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
    mean, spread = standardisation(dataset.features, fold)
    scales = [target_scale(one.target, fold) for one in per_axis]
    modulation = per_axis[0].modulation()
    stack = StackedPhaseModulatedNetworks(
        len(AXES),
        len(mean),
        hidden,
        modulation.shape[1],
        parameters.dropout,
        seeded(parameters.seed),
    )
    data = StackedData(
        inputs=as_tensor((dataset.features - mean) / spread).expand(len(AXES), -1, -1),
        modulation=as_tensor(modulation),
        target=as_tensor(np.stack([one.target / scale for one, scale in zip(per_axis, scales, strict=True)])),
        folds=[fold] * len(AXES),
    )
    train(stack, data, parameters)
    return PhaseModulatedAvoidance(
        tuple(stack.to_network(place, mean, spread, scale) for place, scale in enumerate(scales))
    )


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
