"""Training of feedback models: RMSProp on the squared error of the coupling term (IV.6.2, eq. IV.31).

All models of a stack train simultaneously, each on its own batches. At intervals, the normalised mean squared
error of the parts that may choose a step is evaluated without dropout, and the best weights are kept.

Two steps are kept: the one chosen by validation, which is unbiased, and the one with the lowest error on the
left-out demonstration itself, which is what the dissertation reports and is optimistic.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import Fold, stream
from structlearn.feedback.trainers import Jobs, Model, Trained, TrainingParameters
from structlearn.networks.torch_settings import RootMeanSquarePropagation, as_tensor, one_thread

EVALUATED_AT_ONCE = 128  # samples per model, so that a stack's activations stay in a core's cache
CHOOSING = ("validation", "generalization")
"""Parts that may choose a step. Evaluating the others too would take five times as many samples."""

NEGLIGIBLE = 1e-20  # in single precision, products of smaller phase features and gradients may be denormal

DECAY = 0.9  # of RMSProp's running mean of squared gradients per step, as published


Units = tuple[np.ndarray, np.ndarray]  # mean and scale (D,) of inputs
Forward = Callable[[Tensor, Any, bool], Tensor]
"""Outputs (M, B) or (M, B, D) from inputs (M, B, D) and phase features (M, B, N), None for networks without
them; the flag enables dropout."""


@dataclass(frozen=True)
class Stack:
    """M networks of any kind that train simultaneously."""

    weights: Sequence[Tensor]  # all trained tensors, with a leading model axis
    forward: Forward


@dataclass(frozen=True)
class StackedData:
    """Training data of a stack of M models: the same S samples, scaled for each model."""

    inputs: Tensor  # (M, S, D) standardised inputs
    modulation: Tensor | None  # (S, N) phase features; None for networks without phase modulation
    target: Tensor  # (M, S) scaled coupling terms, or (M, S, D) inputs that an autoencoder reconstructs
    folds: Sequence[Fold]  # split of the samples, per model


def train_weights(
    stack: Stack, data: StackedData, parameters: TrainingParameters
) -> dict[str, tuple[list[Tensor], list[int]]]:
    """Train a stack in place; every model ends with the weights that did best on its validation part.

    Returns by part of `CHOOSING` every model's best weights, and the gradient steps taken until then. Runs on
    one thread, because sums whose order depends on the number of threads are not reproducible; parallelism is
    over processes.
    """
    optimiser = RootMeanSquarePropagation(stack.weights, parameters.learning_rate, DECAY)
    draws = [np.random.default_rng([parameters.seed, stream(fold.number), 1]) for fold in data.folds]
    best = np.full((len(data.folds), len(CHOOSING)), np.inf)
    steps = np.zeros(best.shape, dtype=int)
    kept = {part: [values.detach().clone() for values in stack.weights] for part in CHOOSING}
    with one_thread():
        for start in range(0, parameters.steps, parameters.evaluate_every):
            count = min(parameters.evaluate_every, parameters.steps - start)
            for rows in _batches(data.folds, draws, (count, parameters.batch_size)):
                outputs = stack.forward(_taken(data.inputs, rows), _modulation(data, rows), True)
                squares = (outputs - _taken(data.target, rows)).square()
                # mean over the samples, sum over the models, whose gradients are independent
                optimiser.step(squares.flatten(1).mean(dim=1).sum())
            errors = choosing_errors(stack, data)
            better = errors < best  # False for diverged models (NaN)
            best[better], steps[better] = errors[better], start + count
            for place, part in enumerate(CHOOSING):
                chosen = torch.from_numpy(better[:, place])
                for best_values, values in zip(kept[part], stack.weights, strict=True):
                    best_values[chosen] = values.detach()[chosen]
    restore(stack, kept["validation"])
    return {part: (kept[part], steps[:, place].tolist()) for place, part in enumerate(CHOOSING)}


@torch.no_grad()
def restore(stack: Stack, weights: Sequence[Tensor]) -> None:
    """Copy kept weights back into a stack."""
    for values, kept in zip(stack.weights, weights, strict=True):
        values.copy_(kept)


def train_stack(
    stack: Stack, data: StackedData, parameters: TrainingParameters, model: Callable[[int], Model]
) -> list[Trained[Model]]:
    """Train a stack, and export each of its networks at the step chosen by each part.

    `model`: exports the network of an index with the stack's current weights.
    """
    trained: list[Trained[Model]] = [Trained({}, {}) for _ in data.folds]
    for part, (weights, steps) in train_weights(stack, data, parameters).items():
        if all(len(getattr(fold, part)) for fold in data.folds):
            restore(stack, weights)
            for index, result in enumerate(trained):
                result.models[part], result.steps[part] = model(index), steps[index]
    return trained


def standardised(jobs: Jobs, phases: int = 0, given: Units | None = None) -> tuple[list[Units], Tensor]:
    """Mean and scale (D,) of each job's inputs, and the standardised inputs of all jobs (M, S, D).

    `phases`: 2 to append phase and phase velocity, each with its own scale; else 0. `given`: mean and scale
    for all jobs; default: those of each job's training samples.
    """
    units, inputs = [], []
    for dataset, fold in jobs:
        mean, spread = given or standardisation(dataset.deviation, fold, dataset.groups)
        values = [dataset.deviation]
        for column in (dataset.phase[:, None], dataset.phase_velocity[:, None])[:phases]:
            own = standardisation(column, fold)
            mean, spread = np.append(mean, own[0]), np.append(spread, own[1])
            values.append(column)
        units.append((mean, spread))
        inputs.append((np.hstack(values) - mean) / spread)
    return units, as_tensor(np.ascontiguousarray(np.stack(inputs)))  # a batch takes rows


def scaled_targets(jobs: Jobs, inputs: Tensor, kernel_count: int | None) -> tuple[list[float], StackedData]:
    """Scales of the jobs' targets (M,), and the training data of a stack with inputs (M, S, D).

    `kernel_count`: number of phase features; None for networks without them.
    """
    scales = [target_scale(dataset.target, fold) for dataset, fold in jobs]
    modulation = None if kernel_count is None else phase_features(jobs[0][0].modulation(kernel_count))
    targets = [dataset.target / scale for (dataset, _), scale in zip(jobs, scales, strict=True)]
    return scales, StackedData(inputs, modulation, as_tensor(np.stack(targets)), [fold for _, fold in jobs])


def phase_features(features: np.ndarray) -> Tensor:
    """Phase features (..., N) as a tensor, with 0 for those that are negligible.

    In single precision, features far from a kernel's centre, or their products, are denormal. Arithmetic on
    these takes a quarter to half of a training step, and changed no bit of trained networks.
    """
    return as_tensor(np.where(np.abs(features) < NEGLIGIBLE, 0.0, features)).contiguous()


def choosing_errors(stack: Stack, data: StackedData) -> np.ndarray:
    """Normalised mean squared errors (M, 2) on `CHOOSING` without dropout; NaN for an empty part.

    With several targets per sample, both the squared error and the variance are summed over them.
    """
    rows = [[getattr(fold, part) for part in CHOOSING] for fold in data.folds]
    longest = max(sum(map(len, parts)) for parts in rows)
    padded = np.stack([np.resize(np.concatenate(parts), longest) for parts in rows])
    outputs = predict(stack, data, torch.from_numpy(padded))
    result = np.full((len(rows), len(CHOOSING)), np.nan)
    for model, parts in enumerate(rows):
        start = 0
        for place, chosen in enumerate(parts):
            if len(chosen):
                target = data.target[model, chosen].numpy().astype(float)
                error = np.square(outputs[model, start : start + len(chosen)] - target)
                result[model, place] = error.mean() / target.var(axis=0).mean()
            start += len(chosen)
    return result


@torch.no_grad()
def predict(stack: Stack, data: StackedData, rows: Tensor) -> np.ndarray:
    """Outputs (M, R) or (M, R, D) of a stack for rows (M, R) of each model's samples."""
    outputs = [
        stack.forward(_taken(data.inputs, chosen), _modulation(data, chosen), False)
        for chosen in rows.split(EVALUATED_AT_ONCE, dim=1)
    ]
    return torch.cat(outputs, dim=1).numpy()


def standardisation(
    values: np.ndarray, fold: Fold, groups: Sequence[int] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (D,) of the training samples, and one scale per group of columns, (D,): the RMS of their stds.

    The text feeds its networks with counts. A common scale only changes their unit, whereas a scale per
    column would amplify electrodes that hardly feel the tool and contain mostly noise. Constant groups have
    scale 1.

    `values`: (S, D) samples. `groups`: sizes of groups of adjacent columns with one unit; empty: one group.
    """
    training = values[fold.train]
    parts = np.split(training, np.cumsum(groups)[:-1], axis=1)
    scales = [float(np.sqrt(part.var(axis=0).mean())) or 1.0 for part in parts]
    return training.mean(axis=0), np.repeat(scales, groups or training.shape[1])


def target_scale(target: np.ndarray, fold: Fold) -> float:
    """Std of the training targets. Raises InputError: the targets are constant."""
    scale = float(target[fold.train].std())
    if not scale > 0.0:
        raise InputError("the coupling target is constant: there is nothing to learn")
    return scale


def _batches(
    folds: Sequence[Fold], draws: Sequence[np.random.Generator], shape: tuple[int, int]
) -> Iterator[Tensor]:
    """Batches (M, B) of training rows in shuffled epochs, from a generator per model."""
    count = shape[0] * shape[1]
    stacked = []
    for fold, rng in zip(folds, draws, strict=True):
        epochs = -(-count // len(fold.train))
        order = np.concatenate([rng.permutation(fold.train) for _ in range(epochs)])[:count]
        stacked.append(order.reshape(shape))
    yield from torch.from_numpy(np.stack(stacked, axis=1))


def _taken(values: Tensor, rows: Tensor) -> Tensor:
    """Rows (M, B) of each model's values (M, S, ...)."""
    first = values.shape[1] * torch.arange(len(rows))[:, None]
    return values.flatten(0, 1).index_select(0, (rows + first).reshape(-1)).unflatten(0, rows.shape)


def _modulation(data: StackedData, rows: Tensor) -> Tensor | None:
    """Phase features (M, B, N) of rows (M, B)."""
    if data.modulation is None:
        return None
    return data.modulation.index_select(0, rows.reshape(-1)).unflatten(0, rows.shape)
