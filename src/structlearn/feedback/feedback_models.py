"""The feedback models that are used in the end, trained in three ways.

`pointwise` is the dissertation's: samples are treated as independent, and all are of a board that is tilted.
`level` is ours: it learns from executions on the level board too, where nothing is to be corrected.
`unrolled` is what the dissertation names as future work (V.2): its network goes on training inside a
differentiable primitive, such that the unrolled path follows the corrected demonstration. Which one is better
is decided on the board, in closed loop.
"""

from collections.abc import Mapping

import numpy as np

from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, split
from structlearn.feedback.coupling_dataset import CouplingDataset, concatenated
from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.feedback.supervised_training import train_final
from structlearn.feedback.training_parameters import LEVEL, MODELS, UNROLLED, FeedbackParameters
from structlearn.feedback.unrolled_training import train_unrolled
from structlearn.ground.parallel import parallel_map

Networks = list[tuple[str, PhaseModulatedNetwork]]


def train_models(
    datasets: Mapping[str, CouplingDataset],
    level: Mapping[str, CouplingDataset],
    parameters: FeedbackParameters,
) -> dict[str, Networks]:
    """Train all models for every primitive.

    Args:
        datasets: corrections by the primitive's name.
        level: of `supervision.level_dataset`, likewise.
        parameters: see there.

    Returns:
        By model, its networks by primitive.
    """
    with_level = {name: concatenated([dataset, level[name]]) for name, dataset in datasets.items()}
    learned_from = {model: with_level if model == LEVEL else datasets for model in MODELS}
    work = [(model, dataset, parameters) for model in MODELS for dataset in learned_from[model].values()]
    networks = iter(parallel_map(_trained, work, "training feedback models"))
    return {model: [(name, next(networks)) for name in datasets] for model in MODELS}


def _trained(work: tuple[str, CouplingDataset, FeedbackParameters]) -> PhaseModulatedNetwork:
    model, dataset, parameters = work
    if model == UNROLLED:
        return _train_inside(dataset, parameters)
    return train_final(dataset, parameters.pointwise, parameters.hidden)


def _train_inside(dataset: CouplingDataset, parameters: FeedbackParameters) -> PhaseModulatedNetwork:
    """Start from a pointwise model that has not seen the demonstrations which choose the step."""
    paths = corrected_paths(dataset, SAMPLES)
    training, validation = split(paths, parameters.validation_share, parameters.unrolled.seed)
    seen = np.isin(dataset.demonstration, np.unique(training.demonstration))
    initial = train_final(dataset.where(seen), parameters.pointwise, parameters.hidden)
    return train_unrolled(training, validation, initial, parameters.unrolled)
