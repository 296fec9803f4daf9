"""Code of an autoencoder, then phase kernels (IV.9.3.3): see `pca`."""

from typing import TYPE_CHECKING

import numpy as np

from structlearn.feedback.coupling_model import Jobs, TrainingParameters
from structlearn.feedback.models.pca import Encoder, PrincipalComponents, principal_components

if TYPE_CHECKING:
    from torch import Generator, Tensor

NODES = 100  # Of the hidden layer on either side of the code


class AutoencodedNetwork(PrincipalComponents):
    """How a phase-modulated network of an autoencoder's code is trained."""

    @classmethod
    def encoders(cls, jobs: Jobs, parameters: TrainingParameters) -> list[Encoder]:
        """See `autoencoder`; the codes have as many dimensions as there are principal components."""
        dimensions = np.array([encoder.dimensions for encoder in principal_components(jobs)])
        return autoencoder(jobs, dimensions, parameters)


def autoencoder(jobs: Jobs, dimensions: np.ndarray, parameters: TrainingParameters) -> list[Encoder]:
    """Autoencoders (encoder 100 tanh, linear code, decoder 100 tanh), trained as one stack.

    Folds say which samples train, and which choose the step. `dimensions`: (M,) of each job's code.
    """
    import torch

    from structlearn.feedback.supervised_training import StackedData, standardised, train
    from structlearn.networks.torch_settings import one_thread, seeded

    units, inputs = standardised(jobs)
    network = StackedAutoencoders(inputs.shape[2], dimensions, seeded(parameters.seed))
    train(network, StackedData(inputs, None, inputs, [fold for _, fold in jobs]), parameters)
    with torch.no_grad(), one_thread():
        codes = network.encode(inputs).numpy()
    encoders = []
    for index, (mean, scale) in enumerate(units):
        first, (weights, biases) = network.encoder.layers_of(index)
        used = np.arange(len(biases)) < dimensions[index]
        layers = (first, (weights * used[:, None], biases * used))
        encoders.append(Encoder(mean, scale, layers, codes[index], int(dimensions[index])))
    return encoders


class StackedAutoencoders:
    """M autoencoders, each with its own width of the code.

    `inputs`: number of inputs D. `dimensions`: (M,) width of each model's code.
    """

    def __init__(self, inputs: int, dimensions: np.ndarray, generator: "Generator"):
        from structlearn.networks.stacked_layers import RowLayers
        from structlearn.networks.torch_settings import as_tensor

        models, width = len(dimensions), int(max(dimensions))
        self.encoder = RowLayers.initial(models, (inputs, NODES, width), generator)
        self.decoder = RowLayers.initial(models, (width, NODES, inputs), generator)
        used = np.arange(width) < np.asarray(dimensions)[:, None]
        self.used = as_tensor(used[:, None])  # (M, 1, C)

    def parameters(self) -> "list[Tensor]":
        """Trained parameters."""
        return self.encoder.parameters() + self.decoder.parameters()

    def encode(self, inputs: "Tensor") -> "Tensor":
        """(M, B, D) -> (M, B, C), zero in the dimensions that a model does not have."""
        return self.used * self.encoder.forward(inputs)

    def forward(self, inputs: "Tensor", modulation: None = None, training: bool = False) -> "Tensor":
        """The inputs given back, (M, B, D); there is no modulation to use, and nothing is dropped."""
        return self.decoder.forward(self.encode(inputs))
