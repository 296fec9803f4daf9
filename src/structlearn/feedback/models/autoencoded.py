"""Autoencoder of the deviations, followed by phase kernels on its code (IV.9.3.3); see `pca`."""

from typing import TYPE_CHECKING

import numpy as np

from structlearn.feedback.coupling_model import Jobs, TrainingParameters
from structlearn.feedback.models.pca import Encoder, PrincipalComponents, principal_components

if TYPE_CHECKING:
    from torch import Tensor

NODES = 100  # width of the hidden layer on either side of the code


class AutoencodedNetwork(PrincipalComponents):
    """Trains a phase-modulated network on an autoencoder's code."""

    @classmethod
    def encoders(cls, jobs: Jobs, parameters: TrainingParameters) -> list[Encoder]:
        """As `autoencoder`; the codes have as many dimensions as there are principal components."""
        dimensions = np.array([encoder.dimensions for encoder in principal_components(jobs)])
        return autoencoder(jobs, dimensions, parameters)


def autoencoder(jobs: Jobs, dimensions: np.ndarray, parameters: TrainingParameters) -> list[Encoder]:
    """Autoencoders (encoder 100 tanh, linear code, decoder 100 tanh), trained as one stack.

    Folds say which samples train, and which choose the step. `dimensions`: (M,) of each job's code; a code
    narrower than the widest one is padded with zeros.
    """
    import torch

    from structlearn.feedback.supervised_training import Stack, StackedData, standardised, train
    from structlearn.networks.stacked_layers import RowLayers
    from structlearn.networks.torch_settings import as_tensor, one_thread, seeded

    units, inputs = standardised(jobs)
    channels, width, generator = inputs.shape[2], int(max(dimensions)), seeded(parameters.seed)
    encoder = RowLayers.initial(len(jobs), (channels, NODES, width), generator)
    decoder = RowLayers.initial(len(jobs), (width, NODES, channels), generator)
    used = np.arange(width) < np.asarray(dimensions)[:, None]  # (M, C)
    mask = as_tensor(used[:, None])

    def encode(inputs: "Tensor") -> "Tensor":
        return mask * encoder.forward(inputs)

    def forward(inputs: "Tensor", modulation: None, training: bool) -> "Tensor":
        return decoder.forward(encode(inputs))  # nothing is dropped

    stack = Stack(encoder.parameters() + decoder.parameters(), forward)
    train(stack, StackedData(inputs, None, inputs, [fold for _, fold in jobs]), parameters)
    with torch.no_grad(), one_thread():
        codes = encode(inputs).numpy()
    encoders = []
    for index, (mean, scale) in enumerate(units):
        first, (weights, biases) = encoder.layers_of(index)
        layers = (first, (weights * used[index][:, None], biases * used[index]))
        encoders.append(Encoder(mean, scale, layers, codes[index], int(dimensions[index])))
    return encoders
