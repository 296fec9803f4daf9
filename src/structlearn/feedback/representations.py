"""Features that are learnt before, and apart from, their dependence on phase (IV.9.3.3): the rivals of PMNN.

Principal components or an autoencoder compress the deviations; phase kernels on the code, which is a
phase-modulated network without hidden layer, then give the coupling term. Both compress without knowing what
the code is for, and both count an error in every channel alike (in counts, not in each channel's own std),
so the share of variance that the components keep means what it says and the two codes have the same aim.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from structlearn.feedback.folds import Fold
from structlearn.feedback.supervised_training import StackedData, train
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.networks.stacked_layers import Dropout, RowLayers
from structlearn.networks.torch_settings import as_tensor, one_thread

VARIANCE_KEPT = 0.99
"""Share of the variance that the principal components keep (IV.9.3.3)."""

AUTOENCODER_NODES = 100
"""Nodes of the hidden layer on either side of the code."""


@dataclass(frozen=True)
class Codes:
    """Compressed deviations of every fold.

    Attributes:
        features: (M, S, C) codes; a fold that keeps fewer than C dimensions has zeros in the last ones.
        dimensions: (M,) how many each fold keeps.
    """

    features: np.ndarray
    dimensions: np.ndarray


def principal_components(
    deviation: np.ndarray, folds: Sequence[Fold], variance: float = VARIANCE_KEPT
) -> Codes:
    """Principal components of each fold's training samples.

    Args:
        deviation: (S, D) counts.
        folds: which samples train.
        variance: share of the training variance that is kept, below 1.

    Returns:
        Codes of all samples.
    """
    from sklearn.decomposition import PCA

    models = [PCA(variance, svd_solver="full").fit(deviation[fold.train]) for fold in folds]
    dimensions = np.array([model.n_components_ for model in models])
    values = np.zeros((len(folds), len(deviation), dimensions.max()))
    for index, model in enumerate(models):
        values[index, :, : dimensions[index]] = model.transform(deviation)
    return Codes(values, dimensions)


def autoencoder(
    deviation: np.ndarray, folds: Sequence[Fold], dimensions: np.ndarray, parameters: TrainingParameters
) -> Codes:
    """Codes of autoencoders (encoder 100 tanh, linear code, decoder 100 tanh), trained per fold as one stack.

    Args:
        deviation: (S, D) counts.
        folds: which samples train, and which choose the step at which training stops.
        dimensions: (M,) of each fold's code, e.g. as many as its principal components.
        parameters: of the training; nothing is dropped out of an autoencoder.

    Returns:
        Codes of all samples.
    """
    centred = np.empty((len(folds), *deviation.shape), dtype=np.float32)
    for index, fold in enumerate(folds):
        found = deviation[fold.train]
        centred[index] = (deviation - found.mean(axis=0)) / np.sqrt(found.var(axis=0).mean())
    inputs = as_tensor(centred)
    generator = torch.Generator().manual_seed(parameters.seed)
    network = StackedAutoencoders(deviation.shape[1], dimensions, generator)
    train(network, StackedData(inputs, None, inputs, folds), parameters)
    with torch.no_grad(), one_thread():
        return Codes(network.encode(inputs).numpy(), dimensions)


class StackedFeedForwardNetworks:
    """M ordinary networks with tanh and dropout in every hidden layer.

    With two hidden layers of 100 and 25 this is the phase-modulated network with its modulation taken away:
    the dissertation's rival, on ds or on [ds, p, u].

    Args:
        models: number of networks M.
        inputs: number of inputs D.
        hidden: nodes of each hidden layer.
        dropout: probability with which a hidden node is left out of a training step.
        generator: source of the initial weights and of the dropout masks.
    """

    def __init__(
        self, models: int, inputs: int, hidden: Sequence[int], dropout: float, generator: torch.Generator
    ):
        self.layers = RowLayers.initial(models, (inputs, *hidden, 1), generator)
        self.dropout = Dropout(dropout, generator)

    def parameters(self) -> list[Tensor]:
        """What is trained."""
        return self.layers.parameters()

    def forward(self, inputs: Tensor, modulation: Tensor | None = None, training: bool = False) -> Tensor:
        """Coupling terms (M, B) of standardised inputs (M, B, D); there is no modulation to use."""
        return self.layers.forward(inputs, training, self.dropout).squeeze(-1)


class StackedAutoencoders:
    """M autoencoders, each with its own width of the code.

    Args:
        inputs: number of inputs D.
        dimensions: (M,) width of each model's code.
        generator: source of the initial weights.
    """

    def __init__(self, inputs: int, dimensions: np.ndarray, generator: torch.Generator):
        models, width = len(dimensions), int(max(dimensions))
        self.encoder = RowLayers.initial(models, (inputs, AUTOENCODER_NODES, width), generator)
        self.decoder = RowLayers.initial(models, (width, AUTOENCODER_NODES, inputs), generator)
        used = np.arange(width) < np.asarray(dimensions)[:, None]
        self.used = as_tensor(used[:, None])  # (M, 1, C)

    def parameters(self) -> list[Tensor]:
        """What is trained."""
        return self.encoder.parameters() + self.decoder.parameters()

    def encode(self, inputs: Tensor) -> Tensor:
        """(M, B, D) -> (M, B, C), zero in the dimensions that a model does not have."""
        return self.used * self.encoder.forward(inputs)

    def forward(self, inputs: Tensor, modulation: Tensor | None = None, training: bool = False) -> Tensor:
        """The inputs given back, (M, B, D); there is no modulation to use, and nothing is dropped."""
        return self.decoder.forward(self.encode(inputs))
