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
"""

from dataclasses import dataclass

import numpy as np
import torch

from structlearn.feedback.corrected_paths import CorrectedPaths, unrolled_error
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks
from structlearn.feedback.training_parameters import UnrolledTrainingParameters
from structlearn.ground.errors import InputError
from structlearn.networks.torch_settings import as_tensor, one_thread
from structlearn.primitives import kernels

DEMONSTRATIONS_PER_BATCH = 15
"""Whole demonstrations in a step: as many as there are of one setting."""

VALIDATION_INTERVAL = 50
"""Steps between two looks at the demonstrations that training is stopped on."""


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

    `initial`: where to start: an untrained network, or one trained sample by sample on the training
    demonstrations; its standardisation of the input is kept. Raises InputError: nothing was corrected in the
    demonstrations.
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
        modulation=as_tensor(kernels.unit_features(paths.target.shape[1], len(network.output_weights))),
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
