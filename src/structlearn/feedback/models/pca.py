"""Principal components of the deviations, then phase kernels (IV.9.3.3): features learnt before their use.

Components and autoencoder compress without knowing what the code is for, and both count an error in every
channel alike (in counts, not in each channel's own std), so the share of variance that the components keep
means what it says and the two codes have the same aim. Phase kernels on the code are a phase-modulated
network without hidden layer, and so is the whole: the encoder is folded into it.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from structlearn.feedback.coupling_model import Jobs, Nodes, Trained, TrainingParameters
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.networks.compiled_layers import Layers

VARIANCE_KEPT = 0.99  # Share of the variance that the principal components keep (IV.9.3.3)


class PrincipalComponents(PhaseModulatedNetwork):
    """How a phase-modulated network of a code is trained; the code is that of principal components."""

    @classmethod
    def train(
        cls, jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: Self | None = None
    ) -> list[Trained[PhaseModulatedNetwork]]:
        """See `CouplingModel.train`; from an initial network it goes on as a phase-modulated one."""
        if initial is not None:
            return PhaseModulatedNetwork.train(jobs, parameters, hidden, initial)
        encoders = cls.encoders(jobs, parameters)
        coded = [
            (replace(dataset, deviation=encoder.code, groups=()), fold)
            for (dataset, fold), encoder in zip(jobs, encoders, strict=True)
        ]
        found = PhaseModulatedNetwork.train(coded, parameters, hidden)
        return [
            Trained(
                {
                    part: model.behind(one.mean, one.scale, one.layers)
                    for part, model in trained.models.items()
                },
                trained.steps,
                one.dimensions,
            )
            for trained, one in zip(found, encoders, strict=True)
        ]

    @classmethod
    def encoders(cls, jobs: Jobs, parameters: TrainingParameters) -> "list[Encoder]":
        """What compresses the deviations of each job."""
        return principal_components(jobs)


@dataclass(frozen=True)
class Encoder:
    """What compresses the deviations of a job."""

    mean: np.ndarray  # (D,) taken off the deviations
    scale: np.ndarray  # (D,) by which they are divided then
    layers: Layers  # weights and biases, all tanh but the last, which gives the code
    # (S, C) of all samples; a job that keeps fewer than C dimensions has zeros in the last ones
    code: np.ndarray
    dimensions: int  # how many it keeps


def principal_components(jobs: Jobs, variance: float = VARIANCE_KEPT) -> list[Encoder]:
    """Principal components of each job's training samples.

    `variance`: share of the training variance that is kept, below 1.
    """
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
