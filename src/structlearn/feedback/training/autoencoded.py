"""Autoencoder of the deviations, followed by phase kernels on its code (IV.9.3.3); see `pca`."""

import numpy as np
import torch
from torch import Tensor

from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.supervised_training import Stack, StackedData, standardised, train_weights
from structlearn.feedback.trainers import Jobs, Nodes, Trained, TrainingParameters
from structlearn.feedback.training import pmnn
from structlearn.feedback.training.pca import Encoder, principal_components, train_on_codes
from structlearn.networks.stacked_layers import RowLayers
from structlearn.networks.torch_settings import as_tensor, one_thread, seeded

NODES = 100  # width of the hidden layer on either side of the code


def train(
    jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: CouplingModel | None = None
) -> list[Trained[PhaseModulatedNetwork]]:
    """Train a phase-modulated network on an autoencoder's code; as `pca.train`.

    The codes have as many dimensions as there are principal components.
    """
    if initial is not None:
        return pmnn.train(jobs, parameters, hidden, initial)
    dimensions = np.array([encoder.dimensions for encoder in principal_components(jobs)])
    return train_on_codes(jobs, autoencoder(jobs, dimensions, parameters), parameters, hidden)


def autoencoder(jobs: Jobs, dimensions: np.ndarray, parameters: TrainingParameters) -> list[Encoder]:
    """Autoencoders (encoder 100 tanh, linear code, decoder 100 tanh), trained as one stack.

    Folds say which samples train, and which choose the step. `dimensions`: (M,) of each job's code; a code
    narrower than the widest one is padded with zeros.
    """
    units, inputs = standardised(jobs)
    channels, width, generator = inputs.shape[2], int(max(dimensions)), seeded(parameters.seed)
    encoder = RowLayers.initial(len(jobs), (channels, NODES, width), generator)
    decoder = RowLayers.initial(len(jobs), (width, NODES, channels), generator)
    used = np.arange(width) < np.asarray(dimensions)[:, None]  # (M, C)
    mask = as_tensor(used[:, None])

    def encode(inputs: Tensor) -> Tensor:
        return mask * encoder.forward(inputs)

    def forward(inputs: Tensor, modulation: None, training: bool) -> Tensor:
        return decoder.forward(encode(inputs))  # nothing is dropped

    stack = Stack(encoder.parameters() + decoder.parameters(), forward)
    train_weights(stack, StackedData(inputs, None, inputs, [fold for _, fold in jobs]), parameters)
    with torch.no_grad(), one_thread():
        codes = encode(inputs).numpy()
    encoders = []
    for index, (mean, scale) in enumerate(units):
        first, (weights, biases) = encoder.layers_of(index)
        layers = (first, (weights * used[index][:, None], biases * used[index]))
        encoders.append(Encoder(mean, scale, layers, codes[index], int(dimensions[index])))
    return encoders
