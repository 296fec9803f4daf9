"""Principal components of the deviations, followed by phase kernels on the code (IV.9.3.3).

Principal components and autoencoder compress without knowledge of the coupling term. Both weight errors of
all channels equally (in counts, not in each channel's std), so that both codes minimise the same error. Phase
kernels on the code are a phase-modulated network without hidden layer; the encoder is folded into it.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.models.pmnn import PhaseModulatedNetwork
from structlearn.feedback.trainers import Jobs, Nodes, Trained, TrainingParameters
from structlearn.feedback.training import pmnn
from structlearn.networks.compiled_layers import Layers

VARIANCE_KEPT = 0.99  # share of the variance kept by the principal components (IV.9.3.3)


def train(
    jobs: Jobs, parameters: TrainingParameters, hidden: Nodes = (), initial: CouplingModel | None = None
) -> list[Trained[PhaseModulatedNetwork]]:
    """Train a phase-modulated network on principal components; see `trainers.Trainer`.

    An initial network is trained further as a phase-modulated one.
    """
    if initial is not None:
        return pmnn.train(jobs, parameters, hidden, initial)
    return train_on_codes(jobs, principal_components(jobs), parameters, hidden)


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

    fits = [PCA(variance, svd_solver="full").fit(data.deviation[fold.train]) for data, fold in jobs]
    width = max(fit.n_components_ for fit in fits)
    encoders = []
    for (dataset, _), fit in zip(jobs, fits, strict=True):
        missing = width - fit.n_components_
        code = np.pad(fit.transform(dataset.deviation), ((0, 0), (0, missing)))
        weights = np.pad(fit.components_, ((0, missing), (0, 0)))
        layers = ((weights, np.zeros(width)),)
        encoders.append(Encoder(fit.mean_, np.ones(len(fit.mean_)), layers, code, fit.n_components_))
    return encoders


def train_on_codes(
    jobs: Jobs, encoders: Sequence[Encoder], parameters: TrainingParameters, hidden: Nodes
) -> list[Trained[PhaseModulatedNetwork]]:
    """Networks of the jobs' codes, composed with the encoders into networks of the deviations."""
    coded = [
        (replace(dataset, deviation=encoder.code, groups=()), fold)
        for (dataset, fold), encoder in zip(jobs, encoders, strict=True)
    ]
    composed = []
    trained = pmnn.train(coded, parameters, hidden)
    for of_code, (mean, scale, layers, _, dimensions) in zip(trained, encoders, strict=True):
        models = {
            part: network.compose_encoder(mean, scale, layers) for part, network in of_code.models.items()
        }
        composed.append(Trained(models, of_code.steps, dimensions))
    return composed
