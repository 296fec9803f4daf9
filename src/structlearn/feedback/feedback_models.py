"""The feedback models that are used in the end, trained in three ways.

`pointwise` is the dissertation's: samples are treated as independent, and all are of a board that is tilted.
`level` is ours: it learns from executions on the level board too, where nothing is to be corrected.
`unrolled` is what the dissertation names as future work (V.2): its network goes on training inside a
differentiable primitive, such that the unrolled path follows the corrected demonstration. Which one is better
is decided on the board, in closed loop.
"""

from collections.abc import Hashable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, split
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.coupling_model import CouplingModel, train_final
from structlearn.feedback.training_parameters import LEVEL, MODELS, UNROLLED, FeedbackParameters
from structlearn.ground.parallel import parallel_map

Key = TypeVar("Key", bound=Hashable)


def train_models(
    datasets: Mapping[Key, CouplingDataset],
    level: Mapping[Key, CouplingDataset],
    parameters: FeedbackParameters,
    models: Sequence[str] = MODELS,
) -> dict[str, list[tuple[Key, CouplingModel]]]:
    """Train models for every primitive; of several axes each has a network of its own (IV.6.2.3.2).

    `datasets`: corrections by the primitive's name, or by whatever tells primitive and axis. `level`: of
    `supervision.level_dataset`, likewise; without the model `level` it is not looked at. `models`: which of
    `MODELS` are trained. Returns by model, its networks by the keys of the datasets.
    """
    learned_from = {
        model: {
            key: concatenated([dataset, level[key]]) if model == LEVEL else dataset
            for key, dataset in datasets.items()
        }
        for model in models
    }
    work = [(model, dataset, parameters) for model in models for dataset in learned_from[model].values()]
    networks = iter(parallel_map(_trained, work, "training feedback models"))
    return {model: [(key, next(networks)) for key in datasets] for model in models}


def _trained(work: tuple[str, CouplingDataset, FeedbackParameters]) -> CouplingModel:
    model, dataset, parameters = work
    if model == UNROLLED:
        return _train_inside(dataset, parameters)
    return train_final(parameters.model, dataset, parameters.pointwise, parameters.hidden)


def _train_inside(dataset: CouplingDataset, parameters: FeedbackParameters) -> CouplingModel:
    """Start from a pointwise model that has not seen the demonstrations which choose the step."""
    paths = corrected_paths(dataset, SAMPLES)
    training, validation = split(paths, parameters.validation_share, parameters.unrolled.seed)
    seen = np.isin(dataset.demonstration, np.unique(training.demonstration))
    initial = train_final(parameters.model, dataset.where(seen), parameters.pointwise, parameters.hidden)
    return initial.train_in_unroll(training, validation, parameters.unrolled)
