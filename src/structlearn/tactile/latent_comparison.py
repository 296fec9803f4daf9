"""Training and evaluation of all latent spaces and dynamics, over seeds (II.4.2 to II.4.5).

The seeds are spread over a few stacks, one process each, always the same seeds together: what comes out does
not depend on the number of cores.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd
import torch

from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import as_tensor, one_thread, seeded
from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.latent_evaluation import (
    ChainData,
    SplitData,
    decoded_errors,
    direction_errors,
    forward_errors,
    latent_errors,
    latent_map,
)
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import LatentParameters
from structlearn.tactile.latent_training import (
    CHAIN_STEPS,
    Pairs,
    TrainingData,
    best_start,
    draw_pairs,
    train,
    training_data,
)
from structlearn.tactile.touch_dataset import (
    SPLITS,
    STRIDES,
    TEST_STRIDE,
    TRAIN,
    Chains,
    TouchDataset,
    chains,
)
from structlearn.tactile.units import TouchUnits, touch_units


@dataclass(frozen=True)
class LatentComparison:
    """What came out."""

    models: LatentModels  # all of them, of all seeds
    units: TouchUnits  # that they see touch in
    latent: pd.DataFrame  # `latent_evaluation.latent_errors`
    forward: pd.DataFrame  # `latent_evaluation.forward_errors` on the test split
    decoded: pd.DataFrame  # `latent_evaluation.decoded_errors` on the test split
    directions: pd.DataFrame  # `latent_evaluation.direction_errors` on the test split
    # key figures of the three while they trained, on the test split: `step`, `structure`, `seed`, `quantity`,
    # `value`
    curve: pd.DataFrame
    latent_map: pd.DataFrame  # `latent_evaluation.latent_map` of the first seed

    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)[2:]}


def learn(dataset: TouchDataset, geodesics: Geodesics, parameters: LatentParameters) -> LatentComparison:
    """Train all models and evaluate them.

    `dataset`: samples of touch.

    Raises:
        InputError: a split or a bin has too few samples, no contact is long enough for a chain to train on or
            to test on, or a signal never changes.
    """
    rng = np.random.default_rng(parameters.training.seed)
    taught = _chains(dataset, CHAIN_STEPS, STRIDES, "train")
    units = touch_units(dataset, taught, parameters.map_unit_m)
    pairs = draw_pairs(dataset, geodesics, TRAIN, parameters.pair_pool, rng)
    data = training_data(dataset, pairs, taught, units)
    splits = {}
    for name, split in SPLITS.items():
        compared = draw_pairs(dataset, geodesics, split, parameters.evaluation_pairs, rng)
        splits[name] = _split_data(data, dataset.split == split, compared, units)
    tested = _chains(dataset, parameters.longest_chain, (TEST_STRIDE,), "test")
    groups = np.array_split(np.arange(parameters.seeds), min(parameters.stacks, parameters.seeds))
    work = [
        (tuple(group.tolist()), data, splits, _chain_data(data, tested, units), units, parameters)
        for group in groups
    ]
    stacks, *tables = zip(*parallel_map(_learned, work, "latent spaces", local=True), strict=True)
    latent, forward, decoded, directions, curve = (pd.concat(parts, ignore_index=True) for parts in tables)
    models = LatentModels.joined(stacks)
    shown = latent_map(models, data.signals, dataset)
    return LatentComparison(models, units, latent, forward, decoded, directions, curve, shown)


def _learned(
    work: tuple[tuple[int, ...], TrainingData, dict[str, SplitData], ChainData, TouchUnits, LatentParameters],
) -> tuple[LatentModels | pd.DataFrame, ...]:
    """A trained stack, and its tables in the order of `LatentComparison`."""
    seeds, data, splits, tested, units, parameters = work
    training = parameters.training
    generator = seeded(training.seed * 1000 + seeds[0])
    electrodes = data.signals.shape[1]
    draws = [
        LatentModels.initial(seeds, electrodes, parameters.networks, generator)
        for _ in range(parameters.starts)
    ]
    curve = []
    with one_thread():
        models = best_start(draws, data, training, parameters.start_steps)
        for step in train(models, data, training):
            curve.append(_point(models, splits["test"], tested, training.action_penalty).assign(step=step))
        tables = (
            latent_errors(models, splits),
            forward_errors(models, tested),
            decoded_errors(models, tested, units),
            direction_errors(models, tested, training.action_penalty),
        )
    return models.detached(), *tables, pd.concat(curve, ignore_index=True)


def _point(models: LatentModels, split: SplitData, tested: ChainData, penalty: float) -> pd.DataFrame:
    """Key figures of a stack on the test split: `structure`, `seed`, `quantity`, `value`."""
    keys = ["structure", "seed"]
    latent = latent_errors(models, {"test": split}).melt(
        keys, ["reconstruction", "distances", "pressure"], "quantity"
    )
    forward = forward_errors(models, tested).query("steps == 3 and forward != 'unchanged'")
    forward = forward.assign(quantity="forward " + forward["forward"] + "-" + forward["trained_with"])
    asked = direction_errors(models, tested, penalty).query("comparison == 'encoder'")
    asked = asked.assign(quantity="direction " + asked["inverse"] + "-" + asked["trained_with"])
    asked = asked.groupby([*keys, "quantity"], as_index=False)["distance"].mean()
    columns = [*keys, "quantity", "value"]
    return pd.concat(
        [
            latent[columns],
            forward.rename(columns={"nmse": "value"})[columns],
            asked.rename(columns={"distance": "value"})[columns],
        ],
        ignore_index=True,
    )


def _chains(dataset: TouchDataset, length: int, strides: Sequence[int], split: str) -> Chains:
    """Chains of a split, of which there must be some."""
    found = chains(dataset, length, strides, SPLITS[split])
    if not len(found):
        needed = length * min(strides) / float(dataset.rate_hz)
        raise InputError(
            f"touch: a chain of {length} steps needs a contact that stays pressed for {needed:.2f} s; the "
            f"{split} split has none"
        )
    return found


def _split_data(data: TrainingData, rows: np.ndarray, pairs: Pairs, units: TouchUnits) -> SplitData:
    chosen = torch.from_numpy(np.flatnonzero(rows))
    first, second = (data.signals[torch.from_numpy(found)] for found in (pairs.first, pairs.second))
    geodesic = as_tensor(pairs.distance / units.length)
    return SplitData(data.signals[chosen], data.pressure[chosen], first, second, geodesic)


def _chain_data(data: TrainingData, found: Chains, units: TouchUnits) -> ChainData:
    rows, time_step = torch.from_numpy(found.rows), as_tensor(found.time_step)
    return ChainData(data.signals, rows, as_tensor(found.actions / units.action_scale), time_step)
