"""Representations of the coupling term past obstacles, and the gain from the phase as input (IV.8).

Cross-validation over blocks of consecutive samples. Errors are pooled: squared errors of all held-out samples
over the variance of all targets, axis by axis. If samples were shuffled before they were published, errors
are those of new samples of known demonstrations, not of new demonstrations.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.recorded.coupling.parameters import CouplingParameters
from structlearn.avoidance.avoidance_dataset import AXES, AvoidanceDataset, avoidance_from_table
from structlearn.avoidance.avoidance_network import averaged, selected_inputs
from structlearn.avoidance.features import CouplingModel
from structlearn.avoidance.levenberg_marquardt import VALIDATION
from structlearn.avoidance.network_training import (
    COLUMNS,
    seen_columns,
    stacked,
    train_member,
)
from structlearn.avoidance.rai_2014 import fit_human_inspired
from structlearn.core.errors import MissingInputError
from structlearn.core.metrics import mean_interval, nmse
from structlearn.core.parallel import parallel_map
from structlearn.tasks.task_files import TaskFiles, write_tables

RIDGE, HUMAN_INSPIRED, STOPPED = "ridge", "human_inspired", "network_validation"
NETWORK, ENSEMBLE, PMNN = "network", "ensemble", "pmnn"
# representations, with their inputs besides the features (`network_training.COLUMNS`)
REPRESENTATIONS = (
    (HUMAN_INSPIRED, "features"),
    (STOPPED, "features"),
    *((name, inputs) for name in (RIDGE, NETWORK, ENSEMBLE) for inputs in COLUMNS),
    (PMNN, "phase"),
)
# longest first; the ensemble's first member is the network
FITS = (
    *((ENSEMBLE, inputs) for inputs in reversed(COLUMNS)),
    (PMNN, "phase"),
    (HUMAN_INSPIRED, "features"),
    (STOPPED, "features"),
    *((RIDGE, inputs) for inputs in COLUMNS),
)


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `representation_scores`."""
    samples = avoidance_from_table(files.table("recorded/samples"))
    write_tables(representation_scores(samples, files.entry(CouplingParameters)), folder)


def representation_scores(
    dataset: AvoidanceDataset, parameters: CouplingParameters
) -> dict[str, pd.DataFrame]:
    """Cross-validate every representation; raises MissingInputError for fewer than two samples a fold.

    Returns:
        `scores` per `representation`, its `inputs` and `axis`: held-out `nmse` over all samples, and `train`,
        the mean training error of the folds. `folds`: likewise per `fold`, with the number of held-out
        `samples`. `phase_worth`: `gain`, mean over folds of the held-out error without the phase minus that
        with it, and `half_width` of its 95 % interval.
    """
    if len(dataset) < 2 * parameters.folds:
        raise MissingInputError(f"{len(dataset)} samples are too few for {parameters.folds} folds")
    blocks = np.array_split(np.arange(len(dataset)), parameters.folds)
    work = [
        (dataset, block, (fold, name, inputs), parameters)
        for name, inputs in FITS
        for fold, block in enumerate(blocks)
    ]
    tables = parallel_map(_held_out, work, "representations of the coupling term")
    errors, keys = pd.concat(tables, ignore_index=True), ["representation", "inputs", "axis"]
    summed = errors.groupby(keys, sort=False)[["squared", "train"]].sum()
    scores = summed.rename(columns={"squared": "nmse"})
    scores["train"] /= parameters.folds
    order = [(*pair, axis) for pair in REPRESENTATIONS for axis in AXES]
    folds = errors[[*keys, "fold"]].assign(
        nmse=errors["squared"] * parameters.folds,
        samples=errors["fold"].map(dict(enumerate(map(len, blocks)))),
    )
    scores = scores.loc[[key for key in order if key in scores.index]].reset_index()
    return {"scores": scores, "folds": folds, "phase_worth": _phase_worth(folds)}


def _held_out(
    work: tuple[AvoidanceDataset, np.ndarray, tuple[int, str, str], CouplingParameters],
) -> pd.DataFrame:
    """Errors of one fit on one fold; `squared` is the share in the error over all samples."""
    dataset, block, (fold, name, inputs), parameters = work
    held_out = np.zeros(len(dataset), dtype=bool)
    held_out[block] = True
    training, rest = dataset.where(~held_out), dataset.where(held_out)
    tables = []
    for fitted, model in _fitted(name, inputs, training, fold, parameters).items():
        known, new = (model(its.features, its.phase, its.phase_velocity) for its in (training, rest))
        error = np.square(new - rest.target).sum(axis=0) / (dataset.target.var(axis=0) * len(dataset))
        columns = {"axis": list(AXES), "fold": fold, "squared": error, "train": nmse(known, training.target)}
        tables.append(pd.DataFrame({"representation": fitted, "inputs": inputs} | columns))
    return pd.concat(tables, ignore_index=True)


def _fitted(
    name: str, inputs: str, training: AvoidanceDataset, fold: int, parameters: CouplingParameters
) -> dict[str, CouplingModel]:
    """Coupling models of one fit, keyed by representation."""
    if name == RIDGE:
        return {name: _ridge(training, inputs, parameters.ridge_decay)}
    if name == HUMAN_INSPIRED:
        return {name: fit_human_inspired(training.features, training.target)}
    if name == PMNN:
        from structlearn.avoidance.learned_models import train_phase_modulated  # loads torch

        return {name: train_phase_modulated(training, parameters.pmnn, parameters.pmnn_hidden)}
    network = parameters.network.model_copy(update={"inputs": inputs})
    if name == STOPPED:
        stopped = network.training.model_copy(update={"rule": VALIDATION})
        network = network.model_copy(update={"training": stopped})
        return {name: stacked([train_member(training, network, (fold, 0))], [training], network)}
    members = [train_member(training, network, (fold, member)) for member in range(network.members)]
    return {
        NETWORK: stacked(members[:1], [training], network),
        ENSEMBLE: stacked([averaged(members)], [training], network),
    }


def _ridge(training: AvoidanceDataset, inputs: str, decay: float) -> CouplingModel:
    from sklearn.linear_model import Ridge
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    columns = seen_columns(inputs)
    regression = make_pipeline(StandardScaler(), Ridge(alpha=decay))
    seen = selected_inputs(training.features, training.phase, training.phase_velocity, columns)
    regression.fit(seen, training.target)
    return lambda features, phase, phase_velocity: regression.predict(
        selected_inputs(features, phase, phase_velocity, columns)
    )


def _phase_worth(folds: pd.DataFrame) -> pd.DataFrame:
    """Reductions of the error by phase inputs, paired over the folds."""
    by = folds.sort_values("fold", kind="stable").groupby(["representation", "inputs", "axis"])["nmse"]
    errors, rows = {key: its.to_numpy() for key, its in by}, []
    for (name, inputs, axis), seen in errors.items():
        without = errors.get((name, "features", axis))
        if inputs != "features" and without is not None:
            rows.append((name, inputs, axis, *mean_interval(without - seen)))
    return pd.DataFrame(rows, columns=["representation", "inputs", "axis", "gain", "half_width"])
