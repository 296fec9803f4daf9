"""The feedback models that are used in the end, trained in two ways.

`pointwise` is the dissertation's: samples are treated as independent. `unrolled` is what it names as future
work (V.2): the same network goes on training inside a differentiable primitive, such that the unrolled path
follows the corrected demonstration. Which one is better is decided on the board, in closed loop.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.pmnn import PhaseModulatedNetwork
from structlearn.feedback.supervised_training import TrainingParameters, train_final
from structlearn.feedback.unrolled_training import (
    SAMPLES,
    UnrolledTrainingParameters,
    corrected_paths,
    split,
    train_unrolled,
    unrolled_error,
)
from structlearn.ground.parallel import parallel_map
from structlearn.ground.params import Parameters

POINTWISE, UNROLLED = "pointwise", "unrolled"
MODELS = (POINTWISE, UNROLLED)


class FeedbackParameters(Parameters):
    """Training of the final models.

    Attributes:
        hidden: nodes of the regular hidden layers.
        pointwise: training sample by sample.
        unrolled: training inside the unroll.
        validation_share: of the demonstration numbers, on which training inside the unroll is stopped.
    """

    hidden: tuple[int, ...]
    pointwise: TrainingParameters
    unrolled: UnrolledTrainingParameters
    validation_share: float = Field(gt=0, lt=1)


Networks = list[tuple[str, PhaseModulatedNetwork]]


def train_models(
    datasets: Mapping[str, CouplingDataset], parameters: FeedbackParameters
) -> dict[str, Networks]:
    """Train both models for every primitive.

    Args:
        datasets: by the primitive's name.
        parameters: see there.

    Returns:
        By model, its networks by primitive.
    """
    work = [(model, dataset, parameters) for model in MODELS for dataset in datasets.values()]
    networks = iter(parallel_map(_trained, work, "training feedback models"))
    return {model: [(name, next(networks)) for name in datasets] for model in MODELS}


def path_errors(
    datasets: Mapping[str, CouplingDataset], models: Mapping[str, Mapping[str, PhaseModulatedNetwork]]
) -> pd.DataFrame:
    """Errors of the unrolled roll path, given the recorded sensors, over all demonstrations.

    Args:
        datasets: by the primitive's name, with settings that were and were not learned from.
        models: networks by primitive, by model.

    Returns:
        One row per model, primitive and demonstration: `model`, `primitive`, `setting_deg`, `demonstration`,
        `error_deg` (rms over the movement).
    """
    tables = []
    for name, dataset in datasets.items():
        for model, networks in models.items():
            network = networks[name]
            paths = corrected_paths(dataset, SAMPLES)
            tables.append(
                pd.DataFrame(
                    {
                        "model": model,
                        "primitive": name,
                        "setting_deg": paths.setting,
                        "demonstration": paths.demonstration,
                        "error_deg": np.degrees(unrolled_error(network, paths)),
                    }
                )
            )
    return pd.concat(tables, ignore_index=True)


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
