"""Final feedback models, and the comparison of representations for them.

`pointwise` is the dissertation's: samples are treated as independent, and all come from a tilted board.
`level` is ours: it also learns from executions on the level board, where nothing is to be corrected.
`unrolled` is what the dissertation names as future work (V.2): training continues inside a differentiable
primitive, so that the unrolled path follows the corrected demonstration. Which one is better is decided on
the board, in closed loop.

Representations are compared by leave-one-demonstration-out tests (IV.9.3: table IV.5, figure IV.16). The
folds of a representation train as one stack; the representations are distributed over the cores.
"""

from collections.abc import Hashable, Mapping, Sequence
from itertools import product
from typing import TypeVar

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.core.metrics import mean_interval, nmse, verdict
from structlearn.core.parallel import parallel_map
from structlearn.feedback.corrected_paths import SAMPLES, corrected_paths, split_demonstrations
from structlearn.feedback.coupling_dataset import (
    PARTS,
    CouplingDataset,
    concatenated,
    leave_one_out,
)
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.feedback.trainers import (
    FeedbackNetworkParameters,
    TrainingParameters,
    UnrolledTrainingParameters,
    named_trainer,
    train_final,
)

POINTWISE, LEVEL, UNROLLED = "pointwise", "level", "unrolled"
MODELS = (POINTWISE, LEVEL, UNROLLED)


class FinalModelParameters(FeedbackNetworkParameters):
    """Training of the final models, sample by sample and in the unroll."""

    pointwise: TrainingParameters
    unrolled: UnrolledTrainingParameters
    validation_share: float = Field(gt=0, lt=1)


Key = TypeVar("Key", bound=Hashable)


def train_models(
    datasets: Mapping[Key, CouplingDataset],
    level: Mapping[Key, CouplingDataset],
    parameters: FinalModelParameters,
    models: Sequence[str] = MODELS,
) -> dict[str, list[tuple[Key, CouplingModel]]]:
    """Networks of each model, by the keys of the datasets: one per primitive and axis (IV.6.2.3.2).

    `datasets`: corrections by primitive, or by primitive and axis. `level`: from
    `coupling_targets.level_dataset`, with the same keys; used by the model `level` alone.
    """
    work = [
        (model, concatenated([dataset, level[key]]) if model == LEVEL else dataset, parameters)
        for model in models
        for key, dataset in datasets.items()
    ]
    networks = iter(parallel_map(_trained, work, "training feedback models"))
    return {model: [(key, next(networks)) for key in datasets] for model in models}


def _trained(work: tuple[str, CouplingDataset, FinalModelParameters]) -> CouplingModel:
    from structlearn.feedback.training.pmnn import train_unrolled  # torch

    model, dataset, parameters = work
    if model != UNROLLED:
        return train_final(parameters.network, dataset, parameters.pointwise, parameters.hidden)
    paths = corrected_paths(dataset, SAMPLES)
    training, validation = split_demonstrations(paths, parameters.validation_share, parameters.unrolled.seed)
    # start from a pointwise model that has not seen the validation demonstrations
    seen = np.isin(dataset.demonstration, np.unique(training.demonstration))
    initial = train_final(parameters.network, dataset.where(seen), parameters.pointwise, parameters.hidden)
    return train_unrolled(training, validation, initial, parameters.unrolled)


NETWORKS = {
    "pmnn_100": ("pmnn", (100,)),
    "pmnn_6": ("pmnn", (6,)),
    "pmnn_0": ("pmnn", ()),
    "ffnn_phase": ("ffnn_phase", (100, 25)),
    "ffnn": ("ffnn", (100, 25)),
    "pca": ("pca", ()),
    "autoencoder": ("autoencoded", ()),
}
"""Trainer and widths of the regular hidden layers, by representation; `pmnn_6` is about
as wide as the number of principal components."""

REPRESENTATIONS = tuple(NETWORKS)

STOPPINGS = ("validation", "generalization")
"""The part whose error chooses the step; the dissertation's choice, generalization, is optimistic."""

CLAIMS = (
    ("pmnn_100", "pmnn_0"),
    ("pmnn_0", "ffnn_phase"),
    ("ffnn_phase", "ffnn"),
    ("pmnn_100", "ffnn_phase"),
    ("pmnn_100", "ffnn"),
    ("pmnn_100", "pmnn_6"),
    ("pmnn_100", "pca"),
    ("pmnn_100", "autoencoder"),
    ("pmnn_6", "pca"),
    ("pmnn_6", "autoencoder"),
)
"""Pairs (better, worse) according to figure IV.16 and its text."""


def compare_representations(
    datasets: Mapping[str, CouplingDataset], parameters: TrainingParameters
) -> dict[str, pd.DataFrame]:
    """Train every representation on every fold of every primitive.

    Returns by primitive: `representation`, `fold`, `stopping`, `step`, `train`, `validation`, `test`,
    `generalization` (NMSE at that step) and `dimensions` (of the code; missing without compression). Raises
    InputError: fewer than two demonstrations, too few samples, or a constant target.
    """
    keys = list(product(reversed(REPRESENTATIONS), datasets))  # the autoencoder, which takes longest, first
    work = [(datasets[primitive], parameters, name) for name, primitive in keys]
    found = dict(zip(keys, parallel_map(_evaluated, work, "comparing representations"), strict=True))
    return {
        primitive: pd.concat([found[name, primitive] for name in REPRESENTATIONS], ignore_index=True)
        for primitive in datasets
    }


def _evaluated(work: tuple[CouplingDataset, TrainingParameters, str]) -> pd.DataFrame:
    """Comparison rows of one representation."""
    dataset, parameters, name = work
    folds = leave_one_out(dataset, parameters.chunk_samples, parameters.seed)
    network, hidden = NETWORKS[name]
    train = named_trainer(network)
    results = train([(dataset, fold) for fold in folds], parameters, hidden)
    scored: dict[tuple, list[float]] = {}  # by fold and step: both parts often choose the same step
    rows = []
    for stopping, (fold, trained) in product(STOPPINGS, zip(folds, results, strict=True)):
        at = fold.number, trained.steps[stopping]
        if at not in scored:
            coupling = trained.models[stopping].coupling(
                dataset.deviation, dataset.phase, dataset.phase_velocity
            )
            scored[at] = [float(nmse(coupling[part], dataset.target[part])) for part in fold.parts()]
        keys = {"representation": name, "fold": fold.number, "stopping": stopping}
        row = keys | {"step": trained.steps[stopping]} | dict(zip(PARTS, scored[at], strict=True))
        rows.append(row | {"dimensions": trained.code})
    return pd.DataFrame(rows)


def paired_orderings(table: pd.DataFrame) -> pd.DataFrame:
    """Whether the dissertation's orderings hold, paired over the folds of `compare_representations`.

    Folds share most of their training samples, so their differences are not independent and the intervals
    are somewhat too narrow. Returns per stopping and claim: `better`, `worse` (as claimed), `difference`
    (mean over folds of the generalisation NMSE of `worse` minus that of `better`; positive as claimed),
    `half_width` of its 95 % confidence interval, `p_value` (two-sided Wilcoxon signed-rank test) and the
    `verdict` by the interval: better, worse or undecided.
    """
    from scipy import stats

    rows = []
    for stopping in STOPPINGS:
        errors = table[table["stopping"] == stopping].pivot_table("generalization", "fold", "representation")
        for better, worse in CLAIMS:
            if better in errors and worse in errors:
                difference = (errors[worse] - errors[better]).to_numpy()
                mean, half_width = mean_interval(difference)
                p_value = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
                found = str(verdict(mean - half_width, mean + half_width))
                rows.append((stopping, better, worse, mean, half_width, p_value, found))
    columns = ["stopping", "better", "worse", "difference", "half_width", "p_value", "verdict"]
    return pd.DataFrame(rows, columns=columns)
