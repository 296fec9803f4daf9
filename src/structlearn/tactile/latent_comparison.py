"""Training and evaluation of all latent spaces and dynamics, over seeds (II.4.2 to II.4.5).

The seeds are spread over a few stacks, one process each, always the same seeds together: what comes out does
not depend on the number of cores.

Latent spaces are also learned alone, without dynamics, from one set of touches after another. Every set is
seen in its own units: signals and pressure standardised, distances over their root mean square. So a network
that learned from one set can be asked about another one, whose counts have other scales.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd
import torch

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
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
from structlearn.tactile.latent_parameters import LatentParameters, LatentSpaceParameters
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
    TouchSamples,
    TouchUnits,
    chains,
    touch_units,
)

NO_CHAINS = Chains(np.empty((0, CHAIN_STEPS + 1), dtype=int), np.empty((0, CHAIN_STEPS, 6)), np.empty(0))
"""Dynamics are not trained."""


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

    `dataset`: samples of touch. Raises InputError: a split or a bin has too few samples, no contact is long
    enough for a chain to train on or to test on, or a signal never changes.
    """
    rng = np.random.default_rng(parameters.training.seed)
    taught = _chains(dataset, CHAIN_STEPS, STRIDES, "train")
    units = touch_units(dataset, taught, parameters.map_unit_m)
    pairs = draw_pairs(dataset, geodesics, TRAIN, parameters.pair_pool, rng)
    data = training_data(dataset, pairs, taught, units)
    splits = {}
    for name, split in SPLITS.items():
        compared = draw_pairs(dataset, geodesics, split, parameters.evaluation_pairs, rng)
        splits[name] = asked_of(units, dataset, compared, split)
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


def _chain_data(data: TrainingData, found: Chains, units: TouchUnits) -> ChainData:
    rows, time_step = torch.from_numpy(found.rows), as_tensor(found.time_step)
    return ChainData(data.signals, rows, as_tensor(found.actions / units.action_scale), time_step)


def own_units(samples: TouchDataset, geodesics: Geodesics) -> TouchUnits:
    """Units of a set by its training samples; that of length is the root mean square distance on the skin.

    Raises:
        InputError: there is no training sample, or an electrode, the pressure or the velocity never changes.
    """
    length = float(np.sqrt(np.mean(np.square(geodesics.distance, dtype=float))))
    return touch_units(samples, chains(samples, CHAIN_STEPS, split=TRAIN), length)


def learn_spaces(
    samples: TouchDataset, geodesics: Geodesics, units: TouchUnits, parameters: LatentSpaceParameters
) -> LatentModels:
    """Train autoencoders of all seeds, with and without structure, on the training samples of a set.

    Returns the stack; its dynamics are as they were drawn. Raises InputError: a bin has fewer than two
    training samples.
    """
    rng = np.random.default_rng(parameters.training.seed)
    pairs = draw_pairs(samples, geodesics, TRAIN, parameters.pair_pool, rng)
    return learn_from(samples, pairs, NO_CHAINS, units, parameters)


def learn_from(
    samples: TouchSamples, pairs: Pairs, taught: Chains, units: TouchUnits, parameters: LatentSpaceParameters
) -> LatentModels:
    """Train models of all seeds, with and without structure, on pairs whose distances are known.

    `pairs`: of training samples; `taught`: chains of training samples; without any, dynamics stay as they
    were drawn.
    """
    training = parameters.training
    data = training_data(samples, pairs, taught, units)
    models = LatentModels.initial(
        range(parameters.seeds),
        samples.signals.shape[1],
        parameters.networks,
        seeded(training.seed),
        actions=taught.actions.shape[-1],
    )
    with one_thread():
        for _ in train(models, data, training):
            pass  # only the end counts
    return models.detached()


def seen_in(
    units: TouchUnits, samples: TouchDataset, geodesics: Geodesics, split: int, pairs: int
) -> SplitData:
    """Samples and random pairs of one split, to test latent spaces on (`latent_evaluation.latent_errors`).

    `split`: which samples. Raises InputError: a bin has fewer than two samples of the split.
    """
    found = draw_pairs(samples, geodesics, split, pairs, np.random.default_rng(split))
    return asked_of(units, samples, found, split)


def asked_of(units: TouchUnits, samples: TouchSamples, found: Pairs, split: int) -> SplitData:
    """Samples and given pairs of one split, in the networks' units."""
    rows = samples.split == split
    signals = units.signals(samples.signals)
    return SplitData(
        signals=as_tensor(signals[rows]),
        pressure=as_tensor(units.pressure(samples.pressure[rows])),
        first=as_tensor(signals[found.first]),
        second=as_tensor(signals[found.second]),
        geodesic=as_tensor(found.distance / units.length),
    )
