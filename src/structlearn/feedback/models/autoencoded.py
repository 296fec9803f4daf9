"""Code of an autoencoder, then phase kernels (IV.9.3.3): see `pca`."""

from typing import TYPE_CHECKING, Self

import numpy as np

from structlearn.feedback.coupling_model import Jobs, Nodes, Trained
from structlearn.feedback.models.pca import Encoder, principal_components, train_coded
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.training_parameters import TrainingParameters

if TYPE_CHECKING:
    from torch import Generator, Tensor

NODES = 100
"""Of the hidden layer on either side of the code."""


class AutoencodedNetwork(PhaseModulatedNetwork):
    """How a phase-modulated network of an autoencoder's code is trained."""

    @classmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> list[Trained[PhaseModulatedNetwork]]:
        """See `CouplingModel.train`; the code has as many dimensions as there are principal components."""
        if initial is not None:
            return PhaseModulatedNetwork.train(jobs, parameters, hidden, initial)
        dimensions = np.array([encoder.dimensions for encoder in principal_components(jobs)])
        return train_coded(jobs, autoencoder(jobs, dimensions, parameters), parameters, hidden)


def autoencoder(jobs: Jobs, dimensions: np.ndarray, parameters: TrainingParameters) -> list[Encoder]:
    """Autoencoders (encoder 100 tanh, linear code, decoder 100 tanh), trained as one stack.

    `jobs`: see there; folds say which samples train, and which choose the step at which training stops.
    `dimensions`: (M,) of each job's code. `parameters`: of the training; nothing is dropped out of an
    autoencoder.
    """
    import torch

    from structlearn.feedback.supervised_training import StackedData, train
    from structlearn.networks.torch_settings import as_tensor, one_thread, seeded

    units = []
    for dataset, fold in jobs:
        found = dataset.deviation[fold.train]
        units.append((found.mean(axis=0), np.sqrt(found.var(axis=0).mean())))
    inputs = as_tensor(
        np.stack(
            [(data.deviation - mean) / scale for (data, _), (mean, scale) in zip(jobs, units, strict=True)]
        )
    )
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
        """What is trained."""
        return self.encoder.parameters() + self.decoder.parameters()

    def encode(self, inputs: "Tensor") -> "Tensor":
        """(M, B, D) -> (M, B, C), zero in the dimensions that a model does not have."""
        return self.used * self.encoder.forward(inputs)

    def forward(self, inputs: "Tensor", modulation: None = None, training: bool = False) -> "Tensor":
        """The inputs given back, (M, B, D); there is no modulation to use, and nothing is dropped."""
        return self.decoder.forward(self.encode(inputs))
