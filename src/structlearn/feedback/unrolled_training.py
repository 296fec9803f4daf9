"""Training of a feedback model inside a differentiable unroll (future work of the dissertation, V.2).

    r = R c        loss = mean (R c - r_cd)^2 / mean r_cd^2 + weight mean (c - c_target)^2 / mean c_target^2

Trained sample by sample (`supervised_training`), a model is asked for the right coupling term at every
instant; what counts is where the movement ends up. Here c_t = PMNN(ds_t, G_t) runs through the primitive,
whose state is its own, and the angle r that it adds to the nominal movement is compared with the demonstrated
one. The sensors cannot be differentiated: their deviations are those of the corrected demonstration
(teacher forcing).

Since the primitive is linear in c (`coupling_response`), the loss is that of the coupling terms seen through
the primitive: errors that it averages out weigh little, errors that add up to drift weigh much. So it pays
where what cannot be predicted is in the demonstrated path, such as a hand's tremor, which differentiating
twice magnifies in c_target until it drowns the correction. Where the noise is in the coupling term itself,
single samples are as good or better: a path has fewer independent values, and the primitive blurs what they
tell. For the same reason training from an untrained network is slow without some of the loss on c.

The path needs no file of its own: c_target was computed such that the primitive with it as its coupling
term is the demonstration (`coupling`), so r_cd follows from the coupling dataset.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from pydantic import Field

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_response import coupling_response
from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.ground.signals import time_normalised
from structlearn.networks.torch_settings import as_tensor, one_thread
from structlearn.primitives import canonical, kernels, transformation

PHASE_TOLERANCE = 0.02
"""A demonstration's phase may differ so much from that of one uniform movement from start to end."""

SAMPLES = 250
"""Per demonstration in normalised time: about 100 Hz in movements of 2.6 s, the electrodes' own rate."""

DEMONSTRATIONS_PER_BATCH = 15
"""Whole demonstrations in a step: as many as there are of one setting."""

VALIDATION_INTERVAL = 50
"""Steps between two looks at the demonstrations that training is stopped on."""


class UnrolledTrainingParameters(Parameters):
    """Parameters of training inside the unroll.

    Attributes:
        steps: largest number of steps of the optimiser (Adam).
        learning_rate: of the optimiser.
        dropout: probability with which a hidden node is left out of a step.
        coupling_loss_weight: of the loss on the coupling terms themselves, beside that on the path.
        seed: of the batches and the dropout masks.
    """

    steps: int = Field(ge=1)
    learning_rate: float = Field(gt=0)
    dropout: float = Field(ge=0, lt=1)
    coupling_loss_weight: float = Field(ge=0)
    seed: int = Field(ge=0)


@dataclass(frozen=True)
class CorrectedPaths:
    """Corrected demonstrations of one primitive at the same T samples of normalised time.

    Attributes:
        deviation: (L, T, D) s_actual - s_expected, counts.
        target: (L, T) coupling term of one dimension that was demonstrated.
        correction: (L, T) rad, what was added to the nominal movement from the demonstration's initial state.
        setting: (L,) degrees of board roll.
        demonstration: (L,) number within its setting.
    """

    deviation: np.ndarray
    target: np.ndarray
    correction: np.ndarray
    setting: np.ndarray
    demonstration: np.ndarray

    @property
    def response(self) -> np.ndarray:
        """(T, T) angle over time that a held coupling term adds to a movement."""
        samples = self.target.shape[1]
        return coupling_response(samples, 1.0 / (canonical.TAU_PER_DURATION * (samples - 1)))

    def where(self, mask: np.ndarray) -> Self:
        """The demonstrations of a mask (L,) or of indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def corrected_paths(dataset: CouplingDataset, samples: int) -> CorrectedPaths:
    """Demonstrations of a coupling dataset in normalised time, with the corrections that they asked for.

    The correction is unrolled at the demonstration's own rate, so that nothing faster than the common samples
    folds into it; everything is then interpolated linearly.

    Args:
        dataset: samples of each demonstration from the start to the end of the primitive, on a uniform clock.
        samples: T per demonstration.

    Returns:
        CorrectedPaths in the order of setting, then demonstration.

    Raises:
        InputError: a demonstration is not on a uniform clock from the start to the end of the primitive.
    """
    keys = np.unique(np.column_stack([dataset.setting, dataset.demonstration]), axis=0)
    columns: dict[str, list[np.ndarray]] = {"deviation": [], "target": [], "correction": []}
    for setting, number in keys:
        chosen = np.flatnonzero((dataset.setting == setting) & (dataset.demonstration == number))
        rows = dataset.where(chosen[np.argsort(dataset.time[chosen], kind="stable")])
        _check_whole_movement(rows, f"setting {setting:g}, demonstration {number:g}")
        for name, values in (
            ("deviation", rows.deviation),
            ("target", rows.target[:, None]),
            ("correction", _correction(rows.target)),
        ):
            columns[name].append(time_normalised(values, samples))
    return CorrectedPaths(
        deviation=np.array(columns["deviation"]),
        target=np.array(columns["target"])[..., 0],
        correction=np.array(columns["correction"])[..., 0],
        setting=keys[:, 0],
        demonstration=keys[:, 1].astype(int),
    )


def unrolled_error(network: PhaseModulatedNetwork, paths: CorrectedPaths) -> np.ndarray:
    """Difference between the unrolled and the demonstrated path, given the demonstration's sensors.

    Args:
        network: any feedback model of this coupling dimension, however it was training.
        paths: the demonstrations.

    Returns:
        (L,) rad, root mean square over each demonstration.
    """
    unrolled = network.coupling(paths.deviation, _modulation(network, paths)) @ paths.response.T
    return np.sqrt(np.mean((unrolled - paths.correction) ** 2, axis=1))


def split(paths: CorrectedPaths, share: float, seed: int) -> tuple[CorrectedPaths, CorrectedPaths]:
    """Demonstrations to train on and demonstrations to validate on; no number of a demonstration is in both.

    Args:
        paths: demonstrations of at least two numbers.
        share: of the demonstration numbers, to validate on; at least one number.
        seed: of the choice.

    Returns:
        Training and validation demonstrations.

    Raises:
        InputError: the demonstrations have one number only.
    """
    numbers = np.unique(paths.demonstration)
    if len(numbers) < 2:
        raise InputError(
            "training in the unroll needs at least two demonstration numbers, one to validate on"
        )
    count = min(max(1, round(share * len(numbers))), len(numbers) - 1)
    chosen = np.random.default_rng(seed).choice(numbers, count, replace=False)
    validated = np.isin(paths.demonstration, chosen)
    return paths.where(~validated), paths.where(validated)


def train_unrolled(
    training: CorrectedPaths,
    validation: CorrectedPaths,
    initial: PhaseModulatedNetwork,
    parameters: UnrolledTrainingParameters,
) -> PhaseModulatedNetwork:
    """Train a feedback model such that the unrolled path follows the corrected demonstrations.

    Of all steps looked at, the initial network included, the one with the smallest mean squared unrolled
    error on the validation demonstrations is kept. That is honest only if the initial network has not seen
    them.

    Args:
        training: demonstrations to train on.
        validation: demonstrations that choose the step.
        initial: where to start: an untrained network, or one trained sample by sample on the training
            demonstrations; its standardisation of the input is kept.
        parameters: of the training.

    Returns:
        The trained network.

    Raises:
        InputError: nothing was corrected in the demonstrations.
    """
    target_scale = float(np.sqrt(np.mean(training.target**2)))
    if target_scale == 0.0:
        raise InputError("nothing was corrected in the demonstrations: all coupling targets are 0")
    generator = torch.Generator().manual_seed(parameters.seed)
    stack = StackedPhaseModulatedNetworks.from_networks(
        [initial], [target_scale], parameters.dropout, generator
    )
    optimiser = torch.optim.Adam(stack.parameters(), lr=parameters.learning_rate)
    data = _scaled(training, initial, target_scale)
    best, smallest = initial, np.mean(unrolled_error(initial, validation) ** 2)
    with one_thread():
        for step in range(1, parameters.steps + 1):
            order = torch.randperm(len(data.target), generator=generator)
            loss = _loss(stack, data, order[:DEMONSTRATIONS_PER_BATCH], parameters.coupling_loss_weight)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            if step % VALIDATION_INTERVAL == 0 or step == parameters.steps:
                network = stack.to_network(0, initial.input_mean, initial.input_scale, target_scale)
                error = np.mean(unrolled_error(network, validation) ** 2)
                if error < smallest:
                    best, smallest = network, error
    return best


@dataclass(frozen=True)
class _Scaled:
    """Demonstrations in the units that a stack of one network trains in."""

    inputs: torch.Tensor  # (L, T, D)
    modulation: torch.Tensor  # (T, N)
    target: torch.Tensor  # (L, T)
    correction: torch.Tensor  # (L, T)
    response: torch.Tensor  # (T, T), from scaled coupling terms to scaled corrections


def _scaled(paths: CorrectedPaths, network: PhaseModulatedNetwork, target_scale: float) -> _Scaled:
    path_scale = float(np.sqrt(np.mean(paths.correction**2)))
    return _Scaled(
        inputs=as_tensor((paths.deviation - network.input_mean) / network.input_scale),
        modulation=as_tensor(_modulation(network, paths)),
        target=as_tensor(paths.target / target_scale),
        correction=as_tensor(paths.correction / path_scale),
        response=as_tensor(paths.response * (target_scale / path_scale)),
    )


def _loss(
    stack: StackedPhaseModulatedNetworks, data: _Scaled, chosen: torch.Tensor, weight: float
) -> torch.Tensor:
    """Loss of some whole demonstrations: that on the path, plus that on the coupling terms."""
    inputs = data.inputs[chosen].flatten(0, 1)  # (B T, D)
    modulation = data.modulation.repeat(len(chosen), 1)
    coupling = stack.forward(inputs[None], modulation[None], training=True).reshape(len(chosen), -1)  # (B, T)
    path_loss = (coupling @ data.response.T - data.correction[chosen]).square().mean()
    return path_loss + weight * (coupling - data.target[chosen]).square().mean()


def _modulation(network: PhaseModulatedNetwork, paths: CorrectedPaths) -> np.ndarray:
    return kernels.unit_features(paths.target.shape[1], len(network.phase_biases))  # (T, N)


def _correction(target: np.ndarray) -> np.ndarray:
    """What a coupling target (T,), linear between its samples, adds to a movement: (T, 1) rad."""
    step = 1.0 / (canonical.TAU_PER_DURATION * (len(target) - 1))  # dt / tau
    return transformation.unroll(np.zeros(1), np.zeros(1), target[:, None], step, 1.0).position


def _check_whole_movement(rows: CouplingDataset, name: str) -> None:
    expected, _ = canonical.phase(np.linspace(0.0, 1.0, len(rows.phase)), canonical.TAU_PER_DURATION)
    if len(rows.phase) < 3 or np.abs(rows.phase - expected).max() > PHASE_TOLERANCE:
        raise InputError(f"{name}: not on a uniform clock from the start to the end of the primitive")
