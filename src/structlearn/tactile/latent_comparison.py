"""Training and evaluation of all latent spaces and their dynamics, over seeds (II.4.2 to II.4.5).

All seeds train as one stack. Every error is normalised, so that latent spaces of different scales can be
compared. Tables are long, one row per model and quantity; `structure` and `seed` name the latent space.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from structlearn.core.errors import InputError
from structlearn.networks.torch_settings import as_tensor, one_thread, seeded
from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.latent_dynamics import LatentStep, chained, inferred_action
from structlearn.tactile.latent_models import LatentModels, map_distance
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    NO_INVERSE,
    TRAINED_WITH,
    UNCHANGED,
    LatentParameters,
)
from structlearn.tactile.latent_training import (
    CHAIN_STEPS,
    LatentData,
    best_start,
    draw_pairs,
    encoded,
    latent_data,
    train_latent_spaces,
)
from structlearn.tactile.touch_dataset import (
    LINEAR,
    SPLITS,
    STRIDES,
    TEST_STRIDE,
    TRAIN,
    Chains,
    TouchDataset,
    TouchUnits,
    chains,
    touch_units,
)

# components of an action whose directions are compared
PARTS = {"translation": slice(0, LINEAR), "rotation": slice(LINEAR, None)}
SHORTEST = 1e-9  # floor of a norm in a denominator


@dataclass(frozen=True)
class SplitData:
    """Samples and pairs of one split in network units, to test latent spaces on."""

    signals: Tensor  # (N, E)
    pressure: Tensor  # (N,)
    first: Tensor  # (K, E) signals of each pair's first sample
    second: Tensor  # (K, E) signals of each pair's second sample
    geodesic: Tensor  # (K,)


@dataclass(frozen=True)
class LatentComparison:
    """Trained models and their scores.

    Tables: `latent`, `forward`, `decoded` and `directions`, see the functions `..._errors` (all but the first
    on the test split); `latent_map`, see the function; `curve`, key figures of the first three during
    training, on the test split: `step`, `structure`, `seed`, `quantity`, `value`.
    """

    models: LatentModels  # of all seeds
    units: TouchUnits
    tables: Mapping[str, pd.DataFrame]  # by name


def learn_latent_spaces(
    dataset: TouchDataset, geodesics: Geodesics, parameters: LatentParameters
) -> LatentComparison:
    """Train all models and evaluate them.

    Raises InputError: a split or a bin has too few samples, no contact is long enough for a chain in training
    or test, or a signal never changes.
    """
    rng = np.random.default_rng(parameters.training.seed)
    training = _chains(dataset, CHAIN_STEPS, STRIDES, "train")
    units = touch_units(dataset, training, parameters.map_unit_m)
    pairs = draw_pairs(dataset.split, geodesics, TRAIN, parameters.pair_pool, rng)
    data = latent_data(dataset, pairs, training, units)
    splits = {
        name: split_data(units, dataset, geodesics, split, parameters.evaluation_pairs, rng)
        for name, split in SPLITS.items()
    }
    test_chains = _chains(dataset, parameters.longest_chain, (TEST_STRIDE,), "test")
    actions, time_step = as_tensor(test_chains.actions / units.action_scale), as_tensor(test_chains.time_step)
    tested = replace(data, chains=torch.from_numpy(test_chains.rows), actions=actions, time_step=time_step)
    models, tables = _learned(data, splits, tested, units, parameters)
    shown = latent_map(models, data.signals, dataset)
    return LatentComparison(models, units, tables | {"latent_map": shown})


def initial_draws(electrodes: int, parameters: LatentParameters) -> list[LatentModels]:
    """Untrained models of all seeds, one stack per start.

    The seeds are divided into `stacks` groups. Each draws its initial weights from a generator of its own.
    """
    groups = np.array_split(np.arange(parameters.seeds), min(parameters.stacks, parameters.seeds))
    seeds = [tuple(group.tolist()) for group in groups]
    generators = [seeded(parameters.training.seed * 1000 + first) for first, *_ in seeds]
    return [
        LatentModels.joined(
            [
                LatentModels.initial(group, electrodes, parameters.networks, generator)
                for group, generator in zip(seeds, generators, strict=True)
            ]
        )
        for _ in range(parameters.starts)
    ]


def _learned(
    data: LatentData,
    splits: Mapping[str, SplitData],
    tested: LatentData,
    units: TouchUnits,
    parameters: LatentParameters,
) -> tuple[LatentModels, dict[str, pd.DataFrame]]:
    """A trained stack, and its tables."""
    training, curve = parameters.training, []
    draws = initial_draws(data.signals.shape[1], parameters)
    with one_thread():
        models = best_start(draws, data, training, parameters.start_steps)
        for step in train_latent_spaces(models, data, training):
            curve.append(_point(models, splits["test"], tested, training.action_penalty).assign(step=step))
        tables = {
            "latent": latent_errors(models, splits),
            "forward": forward_errors(models, tested),
            "decoded": decoded_errors(models, tested, units),
            "directions": direction_errors(models, tested, training.action_penalty),
            "curve": pd.concat(curve, ignore_index=True),
        }
    return models.detached(), tables


def _point(models: LatentModels, split: SplitData, tested: LatentData, penalty: float) -> pd.DataFrame:
    """Key figures of a stack on the test split: `structure`, `seed`, `quantity`, `value`."""
    keys, names = ["structure", "seed"], ["reconstruction", "distances", "pressure"]
    latent = latent_errors(models, {"test": split}).melt(keys, names, "quantity")
    forward = forward_errors(models, tested).query("steps == 3 and forward != 'unchanged'")
    forward = forward.assign(quantity="forward " + forward["forward"] + "-" + forward["trained_with"])
    directions = direction_errors(models, tested, penalty).query("comparison == 'encoder'")
    directions = directions.assign(
        quantity="direction " + directions["inverse"] + "-" + directions["trained_with"]
    )
    directions = directions.groupby([*keys, "quantity"], as_index=False)["distance"].mean()
    same = {"nmse": "value", "distance": "value"}
    tables = [
        table.rename(columns=same)[[*keys, "quantity", "value"]] for table in (latent, forward, directions)
    ]
    return pd.concat(tables, ignore_index=True)


def _chains(dataset: TouchDataset, length: int, strides: Sequence[int], split: str) -> Chains:
    """Chains of a split. Raises InputError: there are none."""
    parts = chains(dataset, length, strides, SPLITS[split])
    if not len(parts):
        needed = length * min(strides) / float(dataset.rate_hz)
        raise InputError(
            f"touch: a chain of {length} steps needs a contact that stays pressed for {needed:.2f} s; the "
            f"{split} split has none"
        )
    return parts


def split_data(
    units: TouchUnits,
    samples: TouchDataset,
    geodesics: Geodesics,
    split: int,
    count: int,
    rng: np.random.Generator,
) -> SplitData:
    """Samples and random pairs of one split. Raises InputError: a bin has fewer than two of its samples."""
    pairs = draw_pairs(samples.split, geodesics, split, count, rng)
    rows, signals = samples.split == split, units.signals(samples.signals)
    return SplitData(
        signals=as_tensor(signals[rows]),
        pressure=as_tensor(units.pressure(samples.pressure[rows])),
        first=as_tensor(signals[pairs.first]),
        second=as_tensor(signals[pairs.second]),
        geodesic=as_tensor(pairs.distance / units.length),
    )


@torch.no_grad()
def latent_errors(
    models: LatentModels, splits: Mapping[str, SplitData], every: SplitData | None = None
) -> pd.DataFrame:
    """NMSE of the autoencoders, by the variances in each split or in `every`, a set that it is part of.

    Columns: `structure`, `seed`, `split`, `reconstruction` (mean over electrodes), `worst_electrode` (largest
    over electrodes), `distances` (map against geodesic), `pressure`.
    """
    spaces = models.autoencoders
    tables = []
    for split, data in splits.items():
        signals, first, second = (
            values.T.expand(len(models), -1, -1) for values in (data.signals, data.first, data.second)
        )
        latent = spaces.encoder.forward(signals)
        scale = _variances(data) / _variances(every or data)  # (E + 2,)
        electrodes = scale[:-2] * _nmse(spaces.decoder.forward(latent), signals)  # (M, E)
        distance = map_distance(spaces.encoder.forward(first), spaces.encoder.forward(second))
        errors = {
            "reconstruction": electrodes.mean(dim=1),
            "worst_electrode": electrodes.amax(dim=1),
            "distances": scale[-2] * _nmse(distance, data.geodesic),
            "pressure": scale[-1] * _nmse(latent[:, 2], data.pressure),
        }
        tables.append(_by_model(models, errors, split=split))
    return pd.concat(tables, ignore_index=True)


def _variances(data: SplitData) -> Tensor:
    """(E + 2,) variances of the signals, of the distances and of the pressure."""
    parts = (data.signals, data.geodesic[:, None], data.pressure[:, None])
    return torch.cat([its.var(dim=0, correction=0) for its in parts])


@torch.no_grad()
def forward_errors(models: LatentModels, data: LatentData) -> pd.DataFrame:
    """NMSE of chained predictions, mean over latent dimensions (figure II.4).

    Columns: `structure`, `seed`, `forward`, `trained_with`, `steps` (length of the chain), `nmse`, and its
    parts: `plane`, the first two dimensions, and `third`; with structure these are the map and the pressure.
    The forward model `UNCHANGED` predicts no motion.
    """

    def errors(predicted: Tensor, latent: Tensor, steps: int) -> dict[str, Tensor]:
        nmse = _nmse(predicted, latent)
        return {"nmse": nmse.mean(dim=1), "plane": nmse[:, :2].mean(dim=1), "third": nmse[:, 2]}

    return _by_prediction(models, data, errors)


@torch.no_grad()
def decoded_errors(models: LatentModels, data: LatentData, units: TouchUnits) -> pd.DataFrame:
    """NMSE of decoded predictions against measured touch: comparable between all latent spaces.

    Columns: `structure`, `seed`, `forward`, `trained_with`, `steps`; NMSE of `electrodes` (their mean) and of
    `pressure` p = -mean(s).
    """
    scale, mean = (torch.from_numpy(values).float() for values in (units.signal_scale, units.signal_mean))

    def pressure(signals: Tensor) -> Tensor:
        return -(signals * scale[:, None] + mean[:, None]).mean(dim=-2)

    def errors(predicted: Tensor, latent: Tensor, steps: int) -> dict[str, Tensor]:
        measured = data.signals[data.chains[:, steps]].T
        decoded = models.autoencoders.decoder.forward(predicted)
        return {
            "electrodes": _nmse(decoded, measured.expand_as(decoded)).mean(dim=1),
            "pressure": _nmse(pressure(decoded), pressure(measured)),
        }

    return _by_prediction(models, data, errors)


@torch.no_grad()
def direction_errors(models: LatentModels, data: LatentData, penalty: float) -> pd.DataFrame:
    """Cosine distances of the inverse models, weighted by the norm of the true action (figure II.5).

    The action leads from the second to the third sample of each chain. Its target is either `forward`, the
    forward model's prediction for the true action, or `encoder`, the latent state that followed; both
    inferred actions are compared with the true one, and in `agreement` with each other. `penalty`: beta of
    the inverse models. Columns: `structure`, `seed`, `inverse`, `trained_with`, `comparison`, `part`,
    `distance` (0 to 2).
    """
    latents, actions, time_step = _along_chains(models, data, samples=3)
    step = LatentStep(latents[1], latents[0], actions[0], time_step)
    tables = []
    for inverse, forward in FORWARD_OF.items():
        for trained_with in (NO_INVERSE, inverse):
            dynamics = models.dynamics(forward, trained_with)
            predicted = chained(dynamics, step.latent, actions[1:], time_step)[0]
            by_forward, by_encoder = (
                inferred_action(inverse, dynamics, step, target, penalty)
                for target in (predicted, latents[2])
            )
            comparisons = {
                "forward": (by_forward, actions[1]),
                "encoder": (by_encoder, actions[1]),
                "agreement": (by_encoder, by_forward),
            }
            for (comparison, (actual, wanted)), part in product(comparisons.items(), PARTS):
                columns = PARTS[part]
                distance = _cosine_distance(
                    actual[:, columns], wanted[:, columns], actions[1][:, columns].norm(dim=1)
                )
                keys = {
                    "inverse": inverse,
                    "trained_with": trained_with,
                    "comparison": comparison,
                    "part": part,
                }
                tables.append(_by_model(models, {"distance": distance}, **keys))
    return pd.concat(tables, ignore_index=True)


@torch.no_grad()
def latent_map(models: LatentModels, signals: Tensor, dataset: TouchDataset) -> pd.DataFrame:
    """Samples in the latent space of the first seed with structure (figure II.3).

    `signals` (N, E) in network units. Columns: `x`, `y`, `z` in network units; `electrode` (1 to E) with the
    largest negative change, `split`.
    """
    first = models.autoencoders.encoder.part(slice(0, 1))
    latent = first.forward(signals.T[None])[0].numpy()
    columns = dict(zip("xyz", latent, strict=True))
    return pd.DataFrame(columns | {"electrode": dataset.signals.argmin(axis=1) + 1, "split": dataset.split})


def _by_model(models: LatentModels, errors: Mapping[str, Tensor], **keys: str | int) -> pd.DataFrame:
    """One row per autoencoder: `structure`, `seed`, the keys, and errors (M,)."""
    columns = keys | {name: values.tolist() for name, values in errors.items()}
    return pd.DataFrame(models.keys(), columns=["structure", "seed"]).assign(**columns)


def _by_prediction(
    models: LatentModels, data: LatentData, errors: Callable[[Tensor, Tensor, int], Mapping[str, Tensor]]
) -> pd.DataFrame:
    """Errors by forward model and chain length, computed from predicted and actual latent state (M, 3, B)."""
    latents, actions, time_step = _along_chains(models, data)
    predictions = {(UNCHANGED, NO_INVERSE): latents[:1].expand_as(latents[1:])}
    for forward, losses in TRAINED_WITH.items():
        for trained_with in losses:
            dynamics = models.dynamics(forward, trained_with)
            predictions[forward, trained_with] = chained(dynamics, latents[0], actions, time_step)
    tables = [
        _by_model(
            models,
            errors(latent, latents[steps], steps),
            forward=kind,
            trained_with=trained_with,
            steps=steps,
        )
        for (kind, trained_with), predicted in predictions.items()
        for steps, latent in enumerate(predicted, start=1)
    ]
    return pd.concat(tables, ignore_index=True)


def _along_chains(
    models: LatentModels, data: LatentData, samples: int | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """Latent states (C + 1, M, 3, B), actions (C, M, 6, B) and time steps (B,) of chains up to `samples`."""
    rows = data.chains[:, :samples]
    latents = encoded(models, data.signals, rows.expand(len(models.seeds), -1, -1))
    actions = data.actions[:, : rows.shape[1] - 1].permute(1, 2, 0)[:, None]
    return latents, actions.expand(-1, len(models), -1, -1), data.time_step


def _nmse(prediction: Tensor, target: Tensor) -> Tensor:
    """Mean squared error over variance along the last axis, as `structlearn.core.metrics.nmse`."""
    return (prediction - target).square().mean(dim=-1) / target.var(dim=-1, unbiased=False)


def _cosine_distance(actual: Tensor, wanted: Tensor, weight: Tensor) -> Tensor:
    """Weighted mean (M,) over samples of 1 - cosine between vectors (M, D, B)."""
    norms = actual.norm(dim=1).clamp_min(SHORTEST) * wanted.norm(dim=1).clamp_min(SHORTEST)
    cosine = (actual * wanted).sum(dim=1) / norms
    return (weight * (1.0 - cosine)).sum(dim=-1) / weight.sum(dim=-1)
