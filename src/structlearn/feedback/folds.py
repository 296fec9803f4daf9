"""Which samples train a model and which test it: the leave-one-demonstration-out protocol (IV.9.3).

Fold k leaves out demonstration k of *every* setting as its generalisation part. The rest is shuffled and
split into train, validation and test. The text shuffles single samples. Then the neighbours of every
validation sample, 10 ms away, are training samples: validation and test tell how well a model interpolates,
only the generalisation part tells how well it does on a new demonstration. Longer chunks of consecutive
samples part neighbours; what a demonstration has of its own is on both sides all the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.ground.errors import InputError

PARTS = ("train", "validation", "test", "generalization")

FRACTIONS = (0.075, 0.075)
"""Of the samples that are not left out, for validation and test (IV.9.3)."""


@dataclass(frozen=True)
class Fold:
    """Rows of a dataset by what they are used for; all disjoint."""

    number: int | None  # of the demonstration that is left out; None where none is
    train: np.ndarray  # rows that make gradients, standardisation and principal components
    validation: np.ndarray  # rows that choose the step at which training stops
    test: np.ndarray  # rows of the same demonstrations that choose nothing
    generalization: np.ndarray  # all rows of the left-out demonstration

    @property
    def stream(self) -> int:
        """Which random numbers are the fold's own."""
        return _stream(self.number)

    def parts(self) -> tuple[np.ndarray, ...]:
        """The rows in the order of `PARTS`."""
        return tuple(getattr(self, part) for part in PARTS)


def leave_one_out(
    dataset: CouplingDataset, fractions: Sequence[float], chunk_samples: int, seed: int
) -> list[Fold]:
    """One fold per demonstration number.

    `dataset`: samples of all demonstrations; those of one demonstration follow each other in time.
    `fractions`: of validation and test among the remaining demonstrations; the others train. `chunk_samples`:
    consecutive samples that go to the same part; 1 is the text. Raises InputError: fewer than two
    demonstrations, or a part would be empty.
    """
    numbers = np.unique(dataset.demonstration)
    if len(numbers) < 2:
        raise InputError(f"{len(numbers)} demonstration per setting: nothing is left when one is left out")
    return [_fold(dataset, int(number), fractions, chunk_samples, seed) for number in numbers]


def without_generalization(
    dataset: CouplingDataset, fractions: Sequence[float], chunk_samples: int, seed: int
) -> Fold:
    """The split of all demonstrations, for the model that is used in the end.

    Arguments and errors as `leave_one_out`.
    """
    return _fold(dataset, None, fractions, chunk_samples, seed)


def _fold(
    dataset: CouplingDataset, number: int | None, fractions: Sequence[float], chunk_samples: int, seed: int
) -> Fold:
    left_out = np.full(len(dataset.target), False) if number is None else dataset.demonstration == number
    chunks = _chunks(dataset, chunk_samples)
    remaining = np.unique(chunks[~left_out])
    sizes = [round(fraction * len(remaining)) for fraction in fractions]
    if min(*sizes, len(remaining) - sum(sizes)) < 1:
        raise InputError(f"{len(remaining)} chunks of samples are too few for train, validation and test")
    shuffled = np.random.default_rng([seed, _stream(number)]).permutation(remaining)
    validation, test, train = np.split(shuffled, np.cumsum(sizes))
    train, validation, test = (np.flatnonzero(np.isin(chunks, part)) for part in (train, validation, test))
    return Fold(number, train, validation, test, generalization=np.flatnonzero(left_out))


def _stream(number: int | None) -> int:
    return 0 if number is None else number + 1


def _chunks(dataset: CouplingDataset, chunk_samples: int) -> np.ndarray:
    """Number of the chunk of every sample (S,); no chunk reaches over the end of a demonstration."""
    changes = (dataset.setting[1:] != dataset.setting[:-1]) | (np.diff(dataset.demonstration) != 0)
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1])
    rows = np.arange(len(dataset.target))
    within = rows - np.repeat(starts, np.diff([*starts, len(rows)]))
    first = within % chunk_samples == 0
    return np.cumsum(first) - 1
