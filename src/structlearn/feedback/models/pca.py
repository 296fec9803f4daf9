"""Principal components of the deviations, followed by phase kernels on the code (IV.9.3.3).

Principal components and autoencoder compress without knowledge of the coupling term. Both weight errors of
all channels equally (in counts, not in each channel's std), so that both codes minimise the same error. Phase
kernels on the code are a phase-modulated network without hidden layer; the encoder is folded into it.
"""

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from structlearn.feedback.coupling_model import Jobs, Nodes, Trained, TrainingParameters
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.networks.compiled_layers import Layers

VARIANCE_KEPT = 0.99  # share of the variance kept by the principal components (IV.9.3.3)


class PrincipalComponents(PhaseModulatedNetwork):
    """Trains a phase-modulated network on a code, here of principal components."""

    @classmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> list[Trained[PhaseModulatedNetwork]]:
        """See `CouplingModel.train`; an initial network is trained further as a phase-modulated one."""
        if initial is not None:
            return PhaseModulatedNetwork.train(jobs, parameters, hidden, initial)
        encoders = cls.encoders(jobs, parameters)
        coded = [
            (replace(dataset, deviation=encoder.code, groups=()), fold)
            for (dataset, fold), encoder in zip(jobs, encoders, strict=True)
        ]
        found = []
        trained = PhaseModulatedNetwork.train(coded, parameters, hidden)
        for of_code, (mean, scale, layers, _, dimensions) in zip(trained, encoders, strict=True):
            models = {part: model.behind(mean, scale, layers) for part, model in of_code.models.items()}
            found.append(Trained(models, of_code.steps, dimensions))
        return found

    @classmethod
    def encoders(cls, jobs: Jobs, parameters: TrainingParameters) -> "list[Encoder]":
        """Encoder of the deviations of each job."""
        return principal_components(jobs)


class Encoder(NamedTuple):
    """Compression of the deviations of a job."""

    mean: np.ndarray  # (D,) subtracted from the deviations
    scale: np.ndarray  # (D,) divides them
    layers: Layers  # weights and biases, all tanh except the last, which outputs the code
    # (S, C) of all samples; zero-padded for a job that keeps fewer than C dimensions
    code: np.ndarray
    dimensions: int  # number kept


def principal_components(jobs: Jobs, variance: float = VARIANCE_KEPT) -> list[Encoder]:
    """Principal components of each job's training samples that keep a given share of their variance."""
    from sklearn.decomposition import PCA

    found = [PCA(variance, svd_solver="full").fit(data.deviation[fold.train]) for data, fold in jobs]
    width = max(model.n_components_ for model in found)
    encoders = []
    for (dataset, _), model in zip(jobs, found, strict=True):
        missing = width - model.n_components_
        code = np.pad(model.transform(dataset.deviation), ((0, 0), (0, missing)))
        weights = np.pad(model.components_, ((0, missing), (0, 0)))
        layers = ((weights, np.zeros(width)),)
        encoders.append(Encoder(model.mean_, np.ones(len(model.mean_)), layers, code, model.n_components_))
    return encoders
