"""Training of latent spaces and their dynamics, all variants and seeds at once (II.3.5, II.4.1.3).

Two optimisers take steps in turn: one on the autoencoders (eq. II.23), one on the dynamics (eq. II.24), which
use the current encoders without changing them. Every seed has its own batches; the variants of one seed share
batches, so that their differences are paired.

The learning rate falls to zero along half a cosine. The dissertation gives no schedule; without one RMSProp's
last steps are as large as its first, and errors fluctuate from step to step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from structlearn.core.errors import InputError
from structlearn.networks.torch_settings import (
    RootMeanSquarePropagation,
    as_tensor,
    one_thread,
    seeded,
    square_root,
)
from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.latent_dynamics import LatentStep, chained, inferred_action
from structlearn.tactile.latent_models import LatentModels, latent_losses
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    TRAINED_WITH,
    LatentSpaceParameters,
    LatentTrainingParameters,
)
from structlearn.tactile.touch_dataset import (
    TRAIN,
    Chains,
    TouchDataset,
    TouchSamples,
    TouchUnits,
    chains,
    touch_units,
)

CHAIN_STEPS = 3  # actions per training chain: the previous one, and the C = 2 that are predicted (II.4.4)
DRAWN_AT_ONCE = 100  # steps whose batches are drawn in one call
COMPARED_PAIRS = 4096  # pairs on which starts are compared
SHORTEST_ACTION = 1e-6  # floor of an action's norm in a denominator, in network units

# for training without dynamics
NO_CHAINS = Chains(np.empty((0, CHAIN_STEPS + 1), dtype=int), np.empty((0, CHAIN_STEPS, 6)), np.empty(0))


@dataclass(frozen=True)
class Pairs:
    """Pairs of samples with their geodesic distance."""

    first: np.ndarray  # (K,) rows of the dataset
    second: np.ndarray  # (K,) rows of the dataset
    distance: np.ndarray  # (K,) m


def draw_pairs(
    splits: np.ndarray, geodesics: Geodesics, split: int, count: int, rng: np.random.Generator
) -> Pairs:
    """Random pairs within one of the samples' `splits` (N,), each from the same bin of distances.

    Raises InputError: a bin has fewer than two samples of the split.
    """
    bins = len(geodesics.rows)
    members = [np.flatnonzero(splits[rows] == split) for rows in geodesics.rows]
    if min(len(member) for member in members) < 2:
        raise InputError(f"geodesics: a bin has fewer than two samples of split {split}")
    parts = []
    for place, present in enumerate(members):
        size = count // bins + (place < count % bins)
        first, second = present[rng.integers(0, len(present), (2, size))]
        rows = geodesics.rows[place]
        parts.append((rows[first], rows[second], geodesics.distance[place, first, second]))
    return Pairs(*(np.concatenate(values) for values in zip(*parts, strict=True)))


@dataclass(frozen=True)
class LatentData:
    """Samples, pairs and chains in network units, for training or testing."""

    signals: Tensor  # (N, E) of all samples
    pressure: Tensor  # (N,) of all samples
    pairs: Tensor  # (K, 2) rows
    geodesic: Tensor  # (K,) distance of each pair
    chains: Tensor  # (L, C + 1) rows, C = `CHAIN_STEPS` to train on
    actions: Tensor  # (L, C, 6)
    time_step: Tensor  # (L,) s


def latent_data(samples: TouchSamples, pairs: Pairs, chains: Chains, units: TouchUnits) -> LatentData:
    """All samples in network units, with pairs and chains of one split."""
    return LatentData(
        signals=as_tensor(units.signals(samples.signals)),
        pressure=as_tensor(units.pressure(samples.pressure)),
        pairs=torch.from_numpy(np.stack([pairs.first, pairs.second], axis=1)),
        geodesic=as_tensor(pairs.distance / units.length),
        chains=torch.from_numpy(chains.rows),
        actions=as_tensor(chains.actions / units.action_scale),
        time_step=as_tensor(chains.time_step),
    )


def train_latent_spaces(
    models: LatentModels, data: LatentData, parameters: LatentTrainingParameters
) -> Iterator[int]:
    """Train a stack in place; only its autoencoders if the data have no chains.

    Yields the number of steps, every `evaluate_every` steps and at the end, for evaluation in between.
    """
    rngs = [np.random.default_rng([parameters.seed, seed]) for seed in models.seeds]
    descents = [
        (
            RootMeanSquarePropagation(trained, parameters.learning_rate, parameters.decay),
            loss,
            _batches(len(drawn_from), parameters, rngs),
        )
        for trained, loss, drawn_from in (
            (models.autoencoders.parameters(), autoencoder_losses, data.pairs),
            (models.dynamics_parameters(), dynamics_loss, data.chains),
        )
        if len(drawn_from)
    ]
    for step in tqdm(range(parameters.steps), desc="latent spaces", leave=False, disable=None):
        rate = parameters.learning_rate * 0.5 * (1.0 + np.cos(np.pi * step / parameters.steps))
        for optimiser, loss, batches in descents:
            optimiser.rate = rate
            # the sum over models keeps their gradients separate
            optimiser.step(loss(models, data, next(batches), parameters).sum())
        done = step + 1
        if done % parameters.evaluate_every == 0 or done == parameters.steps:
            yield done


def best_start(
    draws: Sequence[LatentModels], data: LatentData, parameters: LatentTrainingParameters, steps: int
) -> LatentModels:
    """The first of several stacks with the same seeds, with the best autoencoders after some training.

    The loss of distances has local minima, so a map may start folded and stay folded. This shows within a few
    hundred steps in the loss on training pairs, by which the autoencoders are chosen.
    """
    short = parameters.model_copy(update={"steps": steps, "evaluate_every": steps})
    alone = replace(data, chains=data.chains[:0])
    drawn = torch.linspace(0, len(data.pairs) - 1, COMPARED_PAIRS).long().expand(len(draws[0].seeds), -1)
    losses = []
    for models in draws:
        for _ in train_latent_spaces(models, alone, short):
            pass  # train to the end
        with torch.no_grad():
            losses.append(autoencoder_losses(models, data, drawn, parameters))
    best = torch.stack(losses).argmin(dim=0)
    arrays = [models.to_arrays() for models in draws]  # these share memory with the stacks
    for name in (name for name in arrays[0] if name.startswith(("encoder.", "decoder."))):
        for number, other in enumerate(arrays):
            arrays[0][name][best == number] = other[name][best == number]
    return draws[0]


def own_units(samples: TouchDataset, geodesics: Geodesics) -> TouchUnits:
    """Units from a set's training samples; the length unit is the RMS distance on the skin."""
    length = float(np.sqrt(np.mean(np.square(geodesics.distance, dtype=float))))
    return touch_units(samples, chains(samples, CHAIN_STEPS, split=TRAIN), length)


def learn_spaces(
    samples: TouchDataset, geodesics: Geodesics, units: TouchUnits, parameters: LatentSpaceParameters
) -> LatentModels:
    """Train autoencoders of all seeds, with and without structure, on the training samples of a set.

    Raises InputError: a bin has fewer than two training samples.
    """
    rng = np.random.default_rng(parameters.training.seed)
    pairs = draw_pairs(samples.split, geodesics, TRAIN, parameters.pair_pool, rng)
    return learn_from(latent_data(samples, pairs, NO_CHAINS, units), parameters)


def learn_from(data: LatentData, parameters: LatentSpaceParameters) -> LatentModels:
    """Train models of all seeds, with and without structure; without chains, dynamics stay untrained."""
    models = LatentModels.initial(
        range(parameters.seeds),
        data.signals.shape[1],
        parameters.networks,
        seeded(parameters.training.seed),
        actions=data.actions.shape[-1],
    )
    with one_thread():
        for _ in train_latent_spaces(models, data, parameters.training):
            pass  # train to the end
    return models.detached()


def autoencoder_losses(
    models: LatentModels, data: LatentData, drawn: Tensor, parameters: LatentTrainingParameters
) -> Tensor:
    """Loss of each autoencoder (M,) on pairs (S, B) (eq. II.23)."""
    rows = data.pairs[drawn].transpose(1, 2).flatten(1)  # (S, 2 B): all first samples, then all second ones
    losses = latent_losses(
        models.autoencoders,
        models.for_all(data.signals[rows].transpose(1, 2)),
        models.for_all(data.pressure[rows]),
        models.for_all(data.geodesic[drawn]),
    )
    weights = parameters.weights
    structure = weights.distances * losses.distances + weights.pressure * losses.pressure
    return weights.reconstruction * losses.reconstruction + models.structured() * structure


def dynamics_loss(
    models: LatentModels, data: LatentData, drawn: Tensor, parameters: LatentTrainingParameters
) -> Tensor:
    """Loss of the dynamics (eq. II.11, II.24) on chains (S, B), summed over models."""
    latents = encoded(models, data.signals, data.chains[drawn])
    actions = models.for_all(data.actions[drawn].movedim(1, -1)).movedim(1, 0)  # (C, M, 6, B)
    time_step = models.for_all(data.time_step[drawn])[:, None]
    step = LatentStep(latents[1], latents[0], actions[0], time_step)
    forward = inverse = latents.new_zeros(())
    for name, choices in TRAINED_WITH.items():
        times = len(choices)
        predicted = chained(
            models.forward_stack(name),
            step.latent.repeat(times, 1, 1),
            actions[1:].repeat(1, times, 1, 1),
            time_step.repeat(times, 1, 1),
        )
        error = predicted - latents[2:].repeat(1, times, 1, 1)
        forward = forward + error.square().sum() / drawn.shape[-1]
    for name, of in FORWARD_OF.items():
        inferred = inferred_action(
            name, models.dynamics(of, name), step, latents[2], parameters.action_penalty
        )
        inverse = inverse + direction_loss(inferred, actions[1])
    return parameters.weights.forward * forward + parameters.weights.inverse * inverse


def encoded(models: LatentModels, signals: Tensor, rows: Tensor) -> Tensor:
    """Latent states (C + 1, M, 3, B), detached, of signals (N, E) at rows (S, B, C + 1) of chains."""
    flat = rows.transpose(1, 2)
    with torch.no_grad():
        taken = signals.index_select(0, flat.flatten()).unflatten(0, (len(rows), -1)).transpose(1, 2)
        latent = models.autoencoders.encoder.forward(models.for_all(taken))  # (M, 3, (C + 1) B)
    return latent.unflatten(-1, flat.shape[1:]).movedim(2, 0)


def direction_loss(inferred: Tensor, action: Tensor) -> Tensor:
    """L_ID (eq. II.22): squared distance of an action (M, 6, B) from the inferred one, scaled to its length.

    Mean over samples, sum over models.
    """
    length = square_root(inferred.square().sum(dim=1, keepdim=True) + SHORTEST_ACTION**2)
    wanted = action.norm(dim=1, keepdim=True)
    return (inferred / length * wanted - action).square().sum() / action.shape[-1]


def _batches(
    count: int, parameters: LatentTrainingParameters, rngs: Sequence[np.random.Generator]
) -> Iterator[Tensor]:
    """Batches (S, B) of random integers below `count`, from one generator per seed."""
    while True:
        shape = (DRAWN_AT_ONCE, parameters.batch_size)
        yield from torch.from_numpy(np.stack([rng.integers(0, count, shape) for rng in rngs], axis=1))
