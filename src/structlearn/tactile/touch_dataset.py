"""Samples of demonstrated touch, and chains of actions between them (II.4.1).

Recordings of a finger become samples by a low-pass, offset removal, detection of contacts and a split into
parts (`prepare`).

Networks use units in which losses, penalties and weights are comparable. The dissertation trains on raw
counts and balances the losses by weights (II.4.1.3). Here signals and pressure are standardised, map
distances are divided by a length, and actions by one scale each for linear and angular velocity, which keeps
directions within each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from structlearn.core import quaternion, signals
from structlearn.core.artefacts import read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import Skin

TRAIN, VALIDATION, TEST = 0, 1, 2  # indices of the splits
SPLITS = {"train": TRAIN, "validation": VALIDATION, "test": TEST}  # by their names in tables
ROTATION, TRANSLATION, OTHER = 0, 1, 2  # demonstrated motions

STRIDES = (29, 30, 31, 32, 33)  # samples per step in training: 100 Hz / 29 to 100 Hz / 33 (II.4.1.1)
TEST_STRIDE = 31  # samples per step in evaluation
LINEAR = 3  # the first components of an action are linear velocity, the others angular
# by `motion` in a recording's provenance; others are `OTHER`
MOTIONS: Mapping[str | None, int] = {"rotation": ROTATION, "translation": TRANSLATION}


class TouchDataParameters(Parameters):
    """Preparation of samples from recorded counts and poses."""

    rate_hz: float = Field(ge=10, le=1000)
    cutoff_hz: float = Field(gt=0)
    air_s: float = Field(gt=0)
    touched_counts: float = Field(gt=0)
    pressed_counts: float = Field(gt=0)
    contact_s: float = Field(gt=0)
    validation_share: float = Field(gt=0, lt=0.5)
    test_share: float = Field(gt=0, lt=0.5)
    seed: int = Field(ge=0)

    @model_validator(mode="after")
    def _thresholds_rise(self) -> "TouchDataParameters":
        if self.pressed_counts < self.touched_counts:
            raise ValueError("pressed_counts must not be below touched_counts")
        return self


@dataclass(frozen=True)
class TouchSamples:
    """N samples of any skin with E channels, as needed for a latent space."""

    signals: np.ndarray  # (N, E) float32; for a BioTac low-passed counts minus their offset
    pressure: np.ndarray  # (N,) contact pressure; for a BioTac p = -mean of the signals, counts
    split: np.ndarray  # (N,) `TRAIN`, `VALIDATION` or `TEST`

    def __len__(self) -> int:
        """Number of samples N."""
        return len(self.pressure)


@dataclass(frozen=True)
class TouchDataset(TouchSamples):
    """Samples of consecutive contacts, each from touching to lifting; floats are float32.

    Rows of a contact are successive samples on a uniform clock. Splits are by contact, so that neighbouring
    samples are in the same split.
    """

    contact_point: np.ndarray  # (N, 3) m on the skin, finger frame, estimated from the signals
    velocity: np.ndarray  # (N, 6) of the finger in the base frame, m/s and rad/s, low-passed
    orientation: np.ndarray  # (N, 4) of the finger in the base frame, unit quaternions
    contact: np.ndarray  # (N,) number of the contact, ascending
    pressed: np.ndarray  # (N,) whether the pressure suffices to learn dynamics from the sample
    trial: np.ndarray  # (N,) number of the demonstration
    time: np.ndarray  # (N,) s since its start
    motion: np.ndarray  # (N,) `ROTATION`, `TRANSLATION` or `OTHER`
    rate_hz: np.ndarray  # () samples per second


@dataclass(frozen=True)
class Chains:
    """K chains of C successive actions; the published (s_t-1, a_t-1, s_t, a_t, s_t+1) is a chain of C = 2."""

    rows: np.ndarray  # (K, C + 1) rows of the dataset; action c leads from row c to row c + 1
    # (K, C, 6) mean velocity over the step, m/s and rad/s, finger frame at its start; fewer components for a
    # skin that is only pressed
    actions: np.ndarray
    time_step: np.ndarray  # (K,) s per step

    def __len__(self) -> int:
        """Number of chains K."""
        return len(self.rows)


def chains(
    dataset: TouchDataset, length: int, strides: Sequence[int] = STRIDES, split: int | None = None
) -> Chains:
    """All chains of `length` C within one contact whose samples are pressed (II.4.1.1, II.4.1.2).

    Velocities between two samples are averaged in the base frame, then rotated into the finger frame
    (eq. II.25). `strides`: samples per step; chains of all strides are concatenated; `split`: only this one.
    Raises ValueError: length or a stride is below 1.
    """
    if length < 1 or min(strides) < 1:
        raise ValueError(f"chains need positive lengths and strides, have {length} and {tuple(strides)}")
    by_stride = [_chains(dataset, length, stride, split) for stride in strides]
    return Chains(*(np.concatenate(arrays) for arrays in zip(*by_stride, strict=True)))


def write_dataset(dataset: TouchDataset, path: str | Path) -> None:
    """Publish the samples as safetensors."""
    write_tensors(
        vars(dataset), path, "samples of touch; fields of structlearn.tactile.touch_dataset.TouchDataset"
    )


def read_dataset(path: str | Path) -> TouchDataset:
    """Read the samples.

    Raises InputError: the file is missing, damaged or another file.
    """
    tensors = read_tensors(path)
    fields = set(TouchDataset.__dataclass_fields__)
    if set(tensors) != fields:
        raise InputError(f"{path}: holds no samples of touch: {', '.join(sorted(set(tensors) ^ fields))}")
    return TouchDataset(**tensors)


def _chains(
    dataset: TouchDataset, length: int, stride: int, split: int | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    starts = np.arange(max(len(dataset) - length * stride, 0))
    rows = starts[:, None] + stride * np.arange(length + 1)
    kept = dataset.contact[rows[:, 0]] == dataset.contact[rows[:, -1]]
    kept &= dataset.pressed[rows].all(axis=1)
    if split is not None:
        kept &= dataset.split[rows[:, 0]] == split
    rows = rows[kept]
    total = np.vstack([np.zeros(2 * LINEAR), np.cumsum(dataset.velocity, axis=0, dtype=float)])
    mean = (total[rows[:, 1:]] - total[rows[:, :-1]]) / stride
    to_finger = quaternion.conjugate(dataset.orientation[rows[:, :-1]])
    parts = [quaternion.rotate(to_finger, part) for part in np.split(mean, [LINEAR], axis=-1)]
    actions = np.concatenate(parts, axis=-1).astype(np.float32)
    return rows, actions, np.full(len(rows), stride / float(dataset.rate_hz))


@dataclass(frozen=True)
class TouchUnits:
    """Offsets and scales: a quantity in network units is (quantity - offset) / scale."""

    signal_mean: np.ndarray  # (E,) counts
    signal_scale: np.ndarray  # (E,) counts
    pressure_mean: np.ndarray  # () counts
    pressure_scale: np.ndarray  # () counts
    length: np.ndarray  # () m on the skin per map unit
    action_scale: np.ndarray  # (K,) m/s for the first three at most, rad/s for the others; no offset
    likely_action: np.ndarray  # (K,) RMS of the demonstrated actions, m/s and rad/s

    def signals(self, counts: np.ndarray) -> np.ndarray:
        """Standardised signals (..., E) of counts minus their offset."""
        return (counts - self.signal_mean) / self.signal_scale

    def pressure(self, counts: np.ndarray) -> np.ndarray:
        """Standardised pressure (...) of counts."""
        return (counts - self.pressure_mean) / self.pressure_scale


def touch_units(dataset: TouchSamples, chains: Chains, length_m: float) -> TouchUnits:
    """Units from the training samples, and from the actions of training chains.

    `length_m`: m on the skin per map unit. Raises InputError: there is no training sample or chain, or an
    electrode, the pressure or the velocity never changes.
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


def prepare(
    demonstrations: Sequence[Demonstration], skin: Skin, parameters: TouchDataParameters
) -> TouchDataset:
    """Samples of all contacts of all demonstrations, in their order.

    Demonstrations have finger poses and counts, all at `rate_hz`. Splits are drawn by contact, stratified by
    motion. Raises InputError, naming the demonstration: no pose or no touch, other channels than the skin's,
    another rate, no contact, or shorter than the time in the air; or fewer than three contacts in total.
    """
    parts, labels = [], []
    for trial, demonstration in enumerate(demonstrations):
        contacts = _contacts(demonstration, skin, parameters)
        parts += contacts
        labels += [(trial, MOTIONS.get(demonstration.provenance.get("motion"), OTHER))] * len(contacts)
    if len(parts) < 3:
        raise InputError(f"touch: three splits need three contacts, the recordings have {len(parts)}")
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    contact = np.repeat(np.arange(len(parts)), [len(part["pressure"]) for part in parts])
    trials, motions = np.array(labels).T
    measured = columns | {"contact_point": contact_points(columns["signals"], skin)}
    return TouchDataset(
        **{name: values.astype(np.float32) for name, values in measured.items()},
        contact=contact,
        trial=trials[contact],
        motion=motions[contact],
        pressed=columns["pressure"] >= parameters.pressed_counts,
        split=splits(motions, parameters)[contact],
        rate_hz=np.array(parameters.rate_hz),
    )


def splits(motions: np.ndarray, parameters: TouchDataParameters) -> np.ndarray:
    """Split (K,) of every contact, stratified by motions (K,); at least one each for validation and test."""
    rng = np.random.default_rng(parameters.seed)
    order = rng.permutation(len(motions))
    order = order[np.argsort(motions[order], kind="stable")]
    split = np.full(len(motions), TRAIN)
    for number, share in ((TEST, parameters.test_share), (VALIDATION, parameters.validation_share)):
        left = order[split[order] == TRAIN]
        size = max(1, round(share * len(motions)))
        split[left[((np.arange(size) + 0.5) * len(left) / size).astype(int)]] = number
    return split


def _contacts(
    demonstration: Demonstration, skin: Skin, parameters: TouchDataParameters
) -> list[dict[str, np.ndarray]]:
    """Signals, pressure, velocity, orientation and time of every contact of one demonstration."""
    tactile = _checked(demonstration, skin, parameters)
    dt, cutoff = 1 / parameters.rate_hz, parameters.cutoff_hz
    air = round(parameters.air_s * parameters.rate_hz)
    offset = tactile[:air].mean(axis=0)
    signal = signals.low_pass(tactile - offset, dt, cutoff)
    pressure = -signal.mean(axis=1)
    touched = np.concatenate([[False], pressure >= parameters.touched_counts, [False]])
    edges = np.diff(touched.astype(int))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    long = ends - starts >= parameters.contact_s * parameters.rate_hz
    if not long.any():
        raise InputError(
            f"{demonstration.name}: nothing touches for {parameters.contact_s:g} s: the pressure, minus the "
            f"mean of the counts less their offset, is at most {pressure.max():.3g} counts"
        )
    whole = {"signals": signal, "pressure": pressure, "time": dt * np.arange(len(signal))}
    whole |= motion_of(demonstration, dt, cutoff)
    return [
        {name: values[start:end] for name, values in whole.items()}
        for start, end in zip(starts[long], ends[long], strict=True)
    ]


def motion_of(demonstration: Demonstration, dt: float, cutoff_hz: float) -> dict[str, np.ndarray]:
    """`orientation` (T, 4) and `velocity` (T, 6), m/s and rad/s in the base frame, low-passed."""
    turned = quaternion.sign_continuous(demonstration.signal("orientation"))
    orientation = quaternion.normalised(signals.low_pass(turned, dt, cutoff_hz))
    linear = signals.derivative(signals.low_pass(demonstration.position, dt, cutoff_hz), dt)
    velocity = np.hstack([linear, quaternion.angular_velocity(orientation, dt)])
    return {"orientation": orientation, "velocity": velocity}


def _checked(demonstration: Demonstration, skin: Skin, parameters: TouchDataParameters) -> np.ndarray:
    """Counts (T, E) of a demonstration, checked."""
    name = demonstration.name
    if demonstration.tactile is None:
        raise InputError(f"{name}: has no tactile signal; name its topic in the parameters")
    if demonstration.orientation is None:
        raise InputError(f"{name}: has no orientation, without which velocities have no frame of the finger")
    channels = demonstration.tactile.shape[1]
    if channels != len(skin.electrodes):
        raise InputError(
            f"{name}: has {channels} tactile channels, the skin '{skin.name}' {len(skin.electrodes)}"
        )
    if not np.isclose(demonstration.dt * parameters.rate_hz, 1.0, rtol=1e-6):
        raise InputError(f"{name}: has {1 / demonstration.dt:g} samples per s, not {parameters.rate_hz:g}")
    if not np.isfinite(demonstration.tactile).all():
        row, column = np.argwhere(~np.isfinite(demonstration.tactile))[0]
        value = demonstration.tactile[row, column]
        raise InputError(f"{name}: row {row}, electrode {column + 1}: value is {value}")
    shortest = max(parameters.air_s, parameters.contact_s) * parameters.rate_hz
    if len(demonstration.tactile) < max(shortest, 5):
        raise InputError(f"{name}: {len(demonstration.tactile)} samples are too few for air and a contact")
    return demonstration.tactile


def contact_points(signals: np.ndarray, skin: Skin) -> np.ndarray:
    """Contact points (N, 3) m, finger frame, from counts (N, E) minus their offset (II.3.3).

    After Lin et al. 2013: centroids of the electrodes, weighted by their squared negative changes, projected
    onto the skin; counts fall where the fluid is thinned and rise where it bulges. Raises InputError, naming
    the row from 0: other channels than electrodes, a value is NaN or infinite, or nothing touches.
    """
    if signals.ndim != 2 or signals.shape[1] != len(skin.electrodes):
        raise InputError(
            f"touch: signals have shape {signals.shape}, the skin '{skin.name}' has "
            f"{len(skin.electrodes)} electrodes"
        )
    if not np.isfinite(signals).all():
        row, column = np.argwhere(~np.isfinite(signals))[0]
        raise InputError(f"touch: row {row}, electrode {column + 1}: value is {signals[row, column]}")
    weight = np.minimum(signals, 0.0) ** 2
    total = weight.sum(axis=1)
    if not (total > 0).all():
        raise InputError(f"touch: row {np.argmin(total > 0)}: nothing touches, no electrode's counts fell")
    return skin.project(weight @ skin.electrodes / total[:, None])
