"""What demonstrations of touch say about a skin: samples, and chains of actions between them (II.4.1).

Networks see touch in units in which one loss, penalty or weight compares with another. The dissertation
trains on raw counts and evens the losses out by weights (II.4.1.3). Here signals and pressure are
standardised, map distances are divided by a length, and actions by one scale per kind of velocity: within
linear and within angular velocity, directions stay what they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from structlearn.core import quaternion
from structlearn.core.artefacts import read_tensors, write_tensors
from structlearn.core.errors import InputError

TRAIN, VALIDATION, TEST = 0, 1, 2  # numbers of the splits
SPLITS = {"train": TRAIN, "validation": VALIDATION, "test": TEST}  # splits by their names in tables
ROTATION, TRANSLATION, OTHER = 0, 1, 2  # numbers of the motions that were demonstrated

STRIDES = (29, 30, 31, 32, 33)
"""Samples per step of prediction while learning: 100 Hz / 29 to 100 Hz / 33 (II.4.1.1)."""

TEST_STRIDE = 31  # the same for evaluation

ACTION_DIMENSIONS = 6

LINEAR = 3  # the first so many components of an action are linear velocity, the others angular


class TouchSamples(Protocol):
    """N samples of any skin, as far as a latent space is learned from them."""

    @property
    def signals(self) -> np.ndarray:
        """(N, E) of the channels."""

    @property
    def pressure(self) -> np.ndarray:
        """(N,) contact pressure."""

    @property
    def split(self) -> np.ndarray:
        """(N,) `TRAIN`, `VALIDATION` or `TEST`."""


@dataclass(frozen=True)
class TouchDataset:
    """N samples with something on a skin of E electrodes, one contact after the other.

    A contact is what lies between touching and lifting. Its rows are successive samples of a uniform clock.
    Splits are by contact, so that no sample of a split has its neighbour in another.
    """

    signals: np.ndarray  # (N, E) counts less their offset, after the low-pass; float32, as all numbers here
    pressure: np.ndarray  # (N,) counts, p = -mean of the signals
    contact_point: np.ndarray  # (N, 3) m, estimated from the signals, on the skin, frame of the finger
    velocity: np.ndarray  # (N, 6) of the finger in the base frame, m/s and rad/s, after the low-pass
    orientation: np.ndarray  # (N, 4) of the finger in the base frame, unit quaternions
    contact: np.ndarray  # (N,) number of the contact, rising
    pressed: np.ndarray  # (N,) whether the pressure suffices for the dynamics to be learned from the sample
    trial: np.ndarray  # (N,) number of the demonstration
    time: np.ndarray  # (N,) s since its start
    motion: np.ndarray  # (N,) `ROTATION`, `TRANSLATION` or `OTHER`
    split: np.ndarray  # (N,) `TRAIN`, `VALIDATION` or `TEST`
    rate_hz: np.ndarray  # () samples per second

    def __len__(self) -> int:
        """Number of samples N."""
        return len(self.pressure)


@dataclass(frozen=True)
class Chains:
    """K chains of C successive actions; a pair of the text (s_t-1, a_t-1, s_t, a_t, s_t+1) is of C = 2."""

    rows: np.ndarray  # (K, C + 1) rows of the dataset; action c leads from row c to row c + 1
    # (K, C, 6) mean velocity over the step, m/s and rad/s, frame of the finger at its start; a skin that is
    # only pressed has fewer components
    actions: np.ndarray
    time_step: np.ndarray  # (K,) s per step

    def __len__(self) -> int:
        """Number of chains K."""
        return len(self.rows)


def chains(
    dataset: TouchDataset, length: int, strides: Sequence[int] = STRIDES, split: int | None = None
) -> Chains:
    """All chains within one contact whose samples are pressed (II.4.1.1, II.4.1.2).

    Velocities between two samples are averaged in the base frame, then turned into the frame of the finger
    (eq. II.25).

    Args:
        dataset: the samples.
        length: C, steps per chain.
        strides: samples per step; chains of all of them are put one after the other.
        split: only chains of this split; a contact is wholly in one.

    Raises:
        ValueError: length or a stride is below 1.
    """
    if length < 1 or min(strides) < 1:
        raise ValueError(f"chains need positive lengths and strides, have {length} and {tuple(strides)}")
    found = [_chains(dataset, length, stride, split) for stride in strides]
    return Chains(
        *(np.concatenate([getattr(one, name) for one in found]) for name in ("rows", "actions", "time_step"))
    )


def write_dataset(dataset: TouchDataset, path: str | Path) -> None:
    """Publish the samples as safetensors."""
    write_tensors(
        vars(dataset), path, "samples of touch; fields of structlearn.tactile.touch_dataset.TouchDataset"
    )


def read_dataset(path: str | Path) -> TouchDataset:
    """Read the samples.

    Raises:
        InputError: the file is missing, damaged or holds something else.
    """
    tensors = read_tensors(path)
    fields = set(TouchDataset.__dataclass_fields__)
    if set(tensors) != fields:
        raise InputError(f"{path}: holds no samples of touch: {', '.join(sorted(set(tensors) ^ fields))}")
    return TouchDataset(**tensors)


def _chains(dataset: TouchDataset, length: int, stride: int, split: int | None) -> Chains:
    starts = np.arange(max(len(dataset) - length * stride, 0))
    rows = starts[:, None] + stride * np.arange(length + 1)
    kept = dataset.contact[rows[:, 0]] == dataset.contact[rows[:, -1]]
    kept &= dataset.pressed[rows].all(axis=1)
    if split is not None:
        kept &= dataset.split[rows[:, 0]] == split
    rows = rows[kept]
    total = np.vstack([np.zeros(ACTION_DIMENSIONS), np.cumsum(dataset.velocity, axis=0, dtype=float)])
    mean = (total[rows[:, 1:]] - total[rows[:, :-1]]) / stride
    to_finger = quaternion.conjugate(dataset.orientation[rows[:, :-1]])
    actions = np.concatenate(
        [quaternion.rotate(to_finger, mean[..., :3]), quaternion.rotate(to_finger, mean[..., 3:])], axis=-1
    )
    return Chains(rows, actions.astype(np.float32), np.full(len(rows), stride / float(dataset.rate_hz)))


@dataclass(frozen=True)
class TouchUnits:
    """Offsets and scales; a quantity in the networks' units is (quantity - offset) / scale."""

    signal_mean: np.ndarray  # (E,) counts
    signal_scale: np.ndarray  # (E,) counts
    pressure_mean: np.ndarray  # () counts
    pressure_scale: np.ndarray  # () counts
    length: np.ndarray  # () m on the skin per unit of the map
    action_scale: np.ndarray  # (K,) m/s up to three times, rad/s for the others; actions have no offset
    # (K,) root mean squares of the demonstrated actions, m/s and rad/s by component
    likely_action: np.ndarray

    def signals(self, counts: np.ndarray) -> np.ndarray:
        """Standardised signals (..., E) of counts less their offset."""
        return (counts - self.signal_mean) / self.signal_scale

    def pressure(self, counts: np.ndarray) -> np.ndarray:
        """Standardised pressure (...) of counts."""
        return (counts - self.pressure_mean) / self.pressure_scale


def touch_units(dataset: TouchSamples, chains: Chains, length_m: float) -> TouchUnits:
    """Units from the training samples.

    `dataset`: samples of touch; `chains`: of the training split; their actions give the scales and the likely
    actions; `length_m`: m on the skin per unit of the map. Raises InputError: there is no training sample or
    chain, or an electrode, the pressure or the velocity never changes.
    """
    rows = dataset.split == TRAIN
    if not rows.any() or not len(chains):
        raise InputError("touch: no sample or no chain to train on")
    signals, pressure = dataset.signals[rows].astype(float), dataset.pressure[rows].astype(float)
    squared = np.square(chains.actions, dtype=float).mean(axis=(0, 1))
    linear, angular = squared[:LINEAR], squared[LINEAR:]
    kinds = np.sqrt([kind.mean() for kind in (linear, angular) if len(kind)])
    scale = signals.std(axis=0)
    if not scale.all():
        raise InputError(f"touch: electrode {int(np.argmin(scale)) + 1} has the same value in all samples")
    if not pressure.std() > 0 or not kinds.all():
        raise InputError("touch: the pressure or the velocity is the same in all samples")
    return TouchUnits(
        signal_mean=signals.mean(axis=0),
        signal_scale=scale,
        pressure_mean=pressure.mean(),
        pressure_scale=pressure.std(),
        length=np.array(length_m),
        action_scale=np.repeat(kinds, [len(kind) for kind in (linear, angular) if len(kind)]),
        likely_action=np.sqrt(squared),
    )
