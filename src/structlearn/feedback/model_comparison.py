"""Comparison of feedback models by leave-one-demonstration-out tests (IV.9.3: table IV.5, figure IV.16).

All folds of a representation train as one stack; the representations are spread over the cores.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import torch

from structlearn.feedback import representations
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.folds import PARTS, Fold, leave_one_out
from structlearn.feedback.representation_orderings import REPRESENTATIONS, STOPPINGS
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks
from structlearn.feedback.supervised_training import (
    FRACTIONS,
    StackedData,
    evaluate,
    restore,
    standardisation,
    target_scale,
    train,
)
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import as_tensor

HIDDEN = {
    "pmnn_100": (100,),
    "pmnn_6": (6,),
    "pmnn_0": (),
    "ffnn_phase": (100, 25),
    "ffnn": (100, 25),
    "pca": (),
    "autoencoder": (),
}
"""Nodes of the regular hidden layers; `pmnn_6` has about as many as there are principal components."""


def compare_representations(
    datasets: Mapping[str, CouplingDataset], parameters: TrainingParameters
) -> dict[str, pd.DataFrame]:
    """Train every representation on every fold.

    Args:
        datasets: samples by the primitive's name.
        parameters: of the training.

    Returns:
        By primitive: `representation`, `fold`, `stopping`, `step`, `train`, `validation`, `test`,
        `generalization` (NMSE at that step) and `dimensions` (of the code; missing where the deviations are
        not compressed first).

    Raises:
        InputError: fewer than two demonstrations, too few samples, or a constant target.
    """
    work = [(dataset, parameters, name) for name in _LONGEST_FIRST for dataset in datasets.values()]
    tables = iter(parallel_map(_evaluated, work, "comparing representations"))
    found = {name: {primitive: next(tables) for primitive in datasets} for name in _LONGEST_FIRST}
    return {
        primitive: pd.concat([found[name][primitive] for name in REPRESENTATIONS], ignore_index=True)
        for primitive in datasets
    }


_LONGEST_FIRST = ("autoencoder", "ffnn_phase", "ffnn", "pmnn_100", "pmnn_6", "pca", "pmnn_0")


def _evaluated(work: tuple[CouplingDataset, TrainingParameters, str]) -> pd.DataFrame:
    """Rows of one representation."""
    dataset, parameters, name = work
    folds = leave_one_out(dataset, FRACTIONS, parameters.chunk_samples, parameters.seed)
    inputs, dimensions = _inputs(name, dataset, folds, parameters)
    modulated = not name.startswith("ffnn")
    data = StackedData(
        inputs=inputs,
        modulation=as_tensor(dataset.modulation()) if modulated else None,
        target=as_tensor(np.stack([dataset.target / target_scale(dataset.target, fold) for fold in folds])),
        folds=folds,
    )
    generator = torch.Generator().manual_seed(parameters.seed)
    models, width = inputs.shape[0], inputs.shape[2]
    if modulated:
        kernel_count = data.modulation.shape[1]
        network = StackedPhaseModulatedNetworks(
            models, width, HIDDEN[name], kernel_count, parameters.dropout, generator
        )
    else:
        network = representations.StackedFeedForwardNetworks(
            models, width, HIDDEN[name], parameters.dropout, generator
        )
    curves = train(network, data, parameters)
    tables = []
    for stopping in STOPPINGS:
        restore(network, curves.weights[stopping])
        errors = evaluate(network, data)  # (M, 4)
        keys = {
            "representation": name,
            "fold": [fold.number for fold in folds],
            "stopping": stopping,
            "step": curves.steps[curves.best(stopping)],
        }
        values = dict(zip(PARTS, errors.T, strict=True))
        tables.append(pd.DataFrame(keys | values | {"dimensions": dimensions}))
    return pd.concat(tables)


def _inputs(
    name: str, dataset: CouplingDataset, folds: Sequence[Fold], parameters: TrainingParameters
) -> tuple[torch.Tensor, np.ndarray]:
    """Standardised inputs (M, S, D) of a representation and the dimensions (M,) of its code, NaN without.

    The columns of a block share one scale, or one per group; phase and phase velocity have their own.
    """
    blocks = [np.broadcast_to(dataset.deviation, (len(folds), *dataset.deviation.shape))]
    groups = [dataset.groups]
    dimensions = np.full(len(folds), np.nan)
    if name == "ffnn_phase":
        for column in (dataset.phase, dataset.phase_velocity):
            blocks.append(np.broadcast_to(column[:, None], (len(folds), len(column), 1)))
            groups.append(())
    elif name in ("pca", "autoencoder"):
        codes = representations.principal_components(dataset.deviation, folds)
        if name == "autoencoder":
            codes = representations.autoencoder(dataset.deviation, folds, codes.dimensions, parameters)
        blocks, groups, dimensions = [codes.features], [()], codes.dimensions.astype(float)
    inputs = [
        [_standardised(block[model], fold, group) for block, group in zip(blocks, groups, strict=True)]
        for model, fold in enumerate(folds)
    ]
    return torch.from_numpy(np.stack([np.hstack(one) for one in inputs])), dimensions


def _standardised(values: np.ndarray, fold: Fold, groups: Sequence[int]) -> np.ndarray:
    mean, spread = standardisation(values, fold, groups)
    return ((values - mean) / spread).astype(np.float32)
