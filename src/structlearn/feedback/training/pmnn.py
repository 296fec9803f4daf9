"""Training of phase-modulated networks by RMSProp, M of them (folds, axes) as one stack.

    h_1 = tanh(z W_1 + b_1), ...        m = G(p, u) * k * (h_L W_m + b_m)        c = m . w_c

The fixed factors k_i = 1 / |mean of u under kernel i| are not in `pmnn.PhaseModulatedNetwork`; `to_network`
folds them into the phase weights. They change no learnable function. But u is -4.6 in mid-movement and -0.15
at its end, where a correction must still be held; without the factors, weights of late kernels would have to
grow 30 times as large as the others on gradients 30 times as small. RMSProp, which divides each gradient by
its own size, compensates most of that; initial outputs and other optimisers do not.

Networks are trained sample by sample (`train`), or inside a differentiable unroll (`train_unrolled`,
future work of the dissertation, V.2):

    r = R c        loss = mean (R c - r_cd)^2 / mean r_cd^2 + weight mean (c - c_target)^2 / mean c_target^2

Sample by sample, the loss is the error of the coupling term at every instant, whereas the task depends on
where the movement ends. In the unroll, c_t = PMNN(ds_t, G_t) passes through the primitive, and the angle r
that it adds to the nominal movement is compared with the demonstrated one. The sensors are not
differentiable: deviations are those of the corrected demonstration (teacher forcing).

Since the primitive is linear in c (`coupling_response`), errors that average out weigh little, and errors
that add up to drift weigh much. This helps if the noise is in the demonstrated path, such as a hand's tremor,
which differentiating twice amplifies in c_target. If the noise is in the coupling term itself, single samples
are as good or better: a path has fewer independent values.
"""

import math
from collections.abc import Sequence
from typing import Self

import numpy as np
import torch
from torch import Tensor

from structlearn.core.errors import InputError
from structlearn.feedback.corrected_paths import CorrectedPaths, unrolled_error
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.supervised_training import (
    Stack,
    phase_features,
    scaled_targets,
    standardised,
    train_stack,
)
from structlearn.feedback.trainers import Jobs, Nodes, Trained, TrainingParameters, UnrolledTrainingParameters
from structlearn.networks.stacked_layers import Dropout, RowLayers
from structlearn.networks.torch_settings import Adam, as_tensor, one_thread, seeded
from structlearn.primitives import canonical, kernels
from structlearn.primitives.kernels import KERNEL_COUNT, features

MOVEMENT_SAMPLES = 1000  # per movement, to average the phase velocity under each kernel


class StackedPhaseModulatedNetworks:
    """M phase-modulated networks (eq. IV.27-IV.30): no output bias, c = 0 wherever u = 0.

    `inputs`: D. `hidden`: width of each regular hidden layer; nodes are dropped in a training step with
    probability `dropout`. `kernels`: N. `generator`: for initial weights and dropout masks.
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
        self.layers = RowLayers.initial(models, (inputs, *hidden, kernels), generator)
        readout = torch.randn(models, kernels, 1, generator=generator) / math.sqrt(kernels)
        self.output_weights = readout.requires_grad_()
        self.kernel_scale = as_tensor(kernel_scale(kernels))
        self.dropout = Dropout(dropout, generator)

    def parameters(self) -> list[Tensor]:
        """Trained parameters."""
        return [*self.layers.parameters(), self.output_weights]

    def forward(self, inputs: Tensor, modulation: Tensor, training: bool = False) -> Tensor:
        """Coupling terms (M, B) in units of the target's scale.

        `inputs`: (M, B, D) standardised deviations. `modulation`: (M, B, N) phase features G(p, u).
        """
        units = self.layers.forward(inputs, training, self.dropout)
        scaled = self.output_weights * self.kernel_scale[:, None]  # (M, N, 1): scaling G would cost more
        return torch.bmm(modulation * units, scaled).squeeze(-1)

    def to_network(
        self, index: int, input_mean: np.ndarray, input_scale: np.ndarray, output_scale: float
    ) -> PhaseModulatedNetwork:
        """Model `index` of the stack in float64, including the scales of its inputs (D,) and targets."""
        scale = kernel_scale(len(self.kernel_scale))
        *hidden, (phase_weights, phase_biases) = self.layers.layers_of(index)
        return PhaseModulatedNetwork(
            input_mean=np.array(input_mean, dtype=float),
            input_scale=np.array(input_scale, dtype=float),
            hidden=tuple(hidden),
            phase_weights=phase_weights * scale[:, None],
            phase_biases=phase_biases * scale,
            output_weights=self.output_weights[index, :, 0].detach().numpy().astype(float) * output_scale,
        )

    @classmethod
    def from_networks(
        cls,
        networks: Sequence[PhaseModulatedNetwork],
        output_scales: Sequence[float],
        dropout: float,
        generator: torch.Generator,
    ) -> Self:
        """A stack initialised from networks of equal shape, for standardised inputs; inverse of `to_network`.

        `output_scales`: (M,) divide the targets.
        """
        (inputs, *hidden), count = networks[0].sizes, len(networks[0].phase_biases)
        stack = cls(len(networks), inputs, hidden, count, dropout, generator)
        scale = kernel_scale(count)
        for index, (network, output_scale) in enumerate(zip(networks, output_scales, strict=True)):
            phase = (network.phase_weights / scale[:, None], network.phase_biases / scale)
            stack.layers.set_layers_of(index, [*network.hidden, phase])
            stack.output_weights.data[index, :, 0] = torch.tensor(network.output_weights / output_scale)
        return stack


def train(
    jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: CouplingModel | None = None
) -> list[Trained[PhaseModulatedNetwork]]:
    """Train one network per job as a stack; see `trainers.Trainer`.

    Raises TypeError: the initial network is not phase-modulated.
    """
    if not isinstance(initial, PhaseModulatedNetwork | None):
        raise TypeError(f"a phase-modulated network cannot start from a {type(initial).__name__}")
    generator, models = seeded(parameters.seed), len(jobs)
    given = None if initial is None else (initial.input_mean, initial.input_scale)
    count = KERNEL_COUNT if initial is None else initial.kernel_count
    units, inputs = standardised(jobs, given=given)
    scales, data = scaled_targets(jobs, inputs, count)
    if initial is None:
        sizes = (inputs.shape[2], hidden, count)
        stack = StackedPhaseModulatedNetworks(models, *sizes, parameters.dropout, generator)
    else:
        start = [initial] * models
        stack = StackedPhaseModulatedNetworks.from_networks(start, scales, parameters.dropout, generator)
    return train_stack(
        Stack(stack.parameters(), stack.forward),
        data,
        parameters,
        lambda index: stack.to_network(index, *units[index], scales[index]),
    )


def kernel_scale(count: int) -> np.ndarray:
    """Factors k_i = 1 / |mean of u under kernel i| over one movement, (N,)."""
    p, u = canonical.phase(np.linspace(0.0, 1.0, MOVEMENT_SAMPLES), canonical.TAU_PER_DURATION)
    normalised = features(p, np.ones_like(p), count)  # (T, N) psi_i / sum_j psi_j
    return normalised.sum(axis=0) / np.abs(u @ normalised)


DEMONSTRATIONS_PER_BATCH = 15  # whole demonstrations per step: as many as there are of one setting
VALIDATION_INTERVAL = 50  # steps between evaluations for early stopping


def train_unrolled(
    training: CorrectedPaths,
    validation: CorrectedPaths,
    initial: CouplingModel,
    parameters: UnrolledTrainingParameters,
) -> PhaseModulatedNetwork:
    """Train a feedback model such that the unrolled path follows the corrected demonstrations.

    Keeps the network with the smallest mean squared unrolled error on the validation demonstrations, possibly
    the initial one, whose standardisation is kept. This is unbiased only if the initial network has not seen
    them. Raises InputError: the initial network is of another kind, or nothing was corrected.
    """
    if not isinstance(initial, PhaseModulatedNetwork):
        raise InputError(f"only the PMNN can be trained in the unroll, not a {type(initial).__name__}")
    target_scale, path_scale = (
        float(np.sqrt(np.mean(values**2))) for values in (training.target, training.correction)
    )
    if target_scale == 0.0:
        raise InputError("nothing was corrected in the demonstrations: all coupling targets are 0")
    generator = seeded(parameters.seed)
    stack = StackedPhaseModulatedNetworks.from_networks(
        [initial], [target_scale], parameters.dropout, generator
    )
    optimiser = Adam(stack.parameters(), parameters.learning_rate)
    # scaled as in the stack's training; L demonstrations of T samples
    inputs = as_tensor((training.deviation - initial.input_mean) / initial.input_scale)  # (L, T, D)
    samples = training.target.shape[1]
    modulation = phase_features(kernels.unit_features(samples, initial.kernel_count))  # (T, N)
    target = as_tensor(training.target / target_scale)  # (L, T)
    correction = as_tensor(training.correction / path_scale)  # (L, T)
    response = as_tensor(training.response * (target_scale / path_scale))  # (T, T)
    best, smallest = initial, np.mean(unrolled_error(initial, validation) ** 2)
    with one_thread():
        for step in range(1, parameters.steps + 1):
            chosen = torch.randperm(len(target), generator=generator)[:DEMONSTRATIONS_PER_BATCH]
            repeated = modulation.repeat(len(chosen), 1)
            coupling = stack.forward(inputs[chosen].flatten(0, 1)[None], repeated[None], training=True)
            coupling = coupling.reshape(len(chosen), -1)  # (B, T)
            path_loss = (coupling @ response.T - correction[chosen]).square().mean()
            coupling_loss = (coupling - target[chosen]).square().mean()
            loss = path_loss + parameters.coupling_loss_weight * coupling_loss
            optimiser.step(torch.autograd.grad(loss, optimiser.parameters))
            if step % VALIDATION_INTERVAL == 0 or step == parameters.steps:
                network = stack.to_network(0, initial.input_mean, initial.input_scale, target_scale)
                error = np.mean(unrolled_error(network, validation) ** 2)
                if error < smallest:
                    best, smallest = network, error
    return best
