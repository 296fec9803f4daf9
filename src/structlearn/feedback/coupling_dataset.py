"""Supervised data of a feedback model: sensor deviations, phase, and the demonstrated coupling term.

One row per sample, keyed by setting and demonstration; demonstrations with the same number in different
settings are left out together in leave-one-demonstration-out tests. Each dimension of a coupling term is
learned separately (IV.6.2.3.2): a dataset covers one axis, and datasets of one primitive, which differ in
their target alone, share a table.

Fold k of the leave-one-demonstration-out protocol (IV.9.3) leaves out demonstration k of *every* setting as
its generalisation part. The rest is shuffled and split into train, validation and test. The text shuffles
single samples; then the neighbours of every validation sample, 10 ms away, are training samples, and only the
generalisation part measures performance on a new demonstration. Longer chunks of consecutive samples separate
neighbours, but samples of one demonstration are still on both sides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.feedback.coupling import AXES, Axis
from structlearn.primitives import kernels


@dataclass(frozen=True)
class CouplingDataset:
    """Samples of one primitive in all corrected demonstrations."""

    deviation: np.ndarray  # (S, D) s_actual - s_expected: counts, or N and N m of a wrench
    phase: np.ndarray  # (S,) p
    phase_velocity: np.ndarray  # (S,) u
    target: np.ndarray  # (S,) coupling term of one axis, m or rad
    setting: np.ndarray  # (S,) degrees of board roll, or labels
    demonstration: np.ndarray  # (S,) number of the demonstration within its setting, from 0
    time: np.ndarray  # (S,) s since the primitive's start
    groups: tuple[int, ...] = ()  # sizes of groups of adjacent channels with one unit; empty: a single group
    # (S,) cycles since the phase of a rhythmic primitive was 0; its demonstrations make any number of them
    cycle: np.ndarray | None = None

    def modulation(self, kernel_count: int = kernels.KERNEL_COUNT) -> np.ndarray:
        """Phase features G(p, u), (S, N)."""
        return kernels.features(self.phase, self.phase_velocity, kernel_count)

    def where(self, mask: np.ndarray) -> Self:
        """Samples selected by a mask (S,) or by indices."""
        return replace(self, **{name: getattr(self, name)[mask] for name in _columns(self)})


COLUMNS = tuple(field.name for field in fields(CouplingDataset) if field.name not in ("groups", "cycle"))
"""Fields with one value per sample."""


def _columns(dataset: CouplingDataset) -> tuple[str, ...]:
    return COLUMNS if dataset.cycle is None else (*COLUMNS, "cycle")


def concatenated(parts: Sequence[CouplingDataset]) -> CouplingDataset:
    """Concatenation of datasets with the same channels."""
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _columns(parts[0])
    }
    return replace(parts[0], **columns)


def to_table(dataset: CouplingDataset) -> pd.DataFrame:
    """One row per sample of a dataset with settings in degrees; channels are `channel_00` and so on."""
    return _table({"setting_deg": dataset.setting}, dataset, {"target": dataset.target})


def from_table(table: pd.DataFrame) -> CouplingDataset:
    """Dataset from a table of `to_table`."""
    return _dataset(table, "setting_deg", "target")


def to_axes_table(datasets: Mapping[Axis, CouplingDataset]) -> pd.DataFrame:
    """One row per sample for the datasets of one primitive on several axes.

    Columns: `setting` (a label), `demonstration`, `time_s`, `phase`, `phase_velocity`, `target_<axis>`, and
    the deviation of each channel: `channel_00`, ... in the first group, `channel_<group>_00`, ... in others;
    `cycle` if the primitive is rhythmic.
    """
    first = next(iter(datasets.values()))
    keys = {"setting": first.setting.astype(str).astype(object)}
    targets = {f"target_{axis}": datasets[axis].target for axis in AXES if axis in datasets}
    return _table(keys, first, targets)


def from_axes_table(table: pd.DataFrame) -> dict[Axis, CouplingDataset]:
    """Datasets by axis from a table of `to_axes_table`. Raises KeyError: it is another table."""
    axes = [axis for axis in AXES if f"target_{axis}" in table.columns]
    if not axes:
        raise KeyError("target_<axis>")
    first = _dataset(table, "setting", f"target_{axes[0]}")
    return {axis: replace(first, target=table[f"target_{axis}"].to_numpy(float)) for axis in axes}


def _table(
    keys: Mapping[str, np.ndarray], dataset: CouplingDataset, targets: Mapping[str, np.ndarray]
) -> pd.DataFrame:
    times = {"demonstration": dataset.demonstration, "time_s": dataset.time}
    phases = {"phase": dataset.phase, "phase_velocity": dataset.phase_velocity}
    groups = dataset.groups or (dataset.deviation.shape[1],)
    names = [
        f"channel_{f'{group}_' if group else ''}{index:02d}"
        for group, count in enumerate(groups)
        for index in range(count)
    ]
    channels = dict(zip(names, dataset.deviation.T, strict=True))
    cycle = {} if dataset.cycle is None else {"cycle": dataset.cycle}
    return pd.DataFrame({**keys, **times, **phases, **cycle, **targets, **channels})


def _dataset(table: pd.DataFrame, setting: str, target: str) -> CouplingDataset:
    channels = [name for name in table.columns if name.startswith("channel_")]
    group_of = [name.rpartition("_")[0] for name in channels]
    groups = tuple(group_of.count(group) for group in dict.fromkeys(group_of))
    return CouplingDataset(
        deviation=table[channels].to_numpy(float),
        phase=table["phase"].to_numpy(float),
        phase_velocity=table["phase_velocity"].to_numpy(float),
        target=table[target].to_numpy(float),
        setting=table[setting].to_numpy(float if setting == "setting_deg" else str),
        demonstration=table["demonstration"].to_numpy(int),
        time=table["time_s"].to_numpy(float),
        groups=groups if len(groups) > 1 else (),
        cycle=table["cycle"].to_numpy(float) if "cycle" in table else None,
    )


PARTS = ("train", "validation", "test", "generalization")

FRACTIONS = (0.075, 0.075)  # for validation and test, of the samples that are not left out (IV.9.3)


@dataclass(frozen=True)
class Fold:
    """Rows of a dataset by use; disjoint."""

    number: int | None  # of the demonstration that is left out, if any
    train: np.ndarray  # for gradients, standardisation and principal components
    validation: np.ndarray  # for early stopping
    test: np.ndarray  # of the same demonstrations, used for no decision
    generalization: np.ndarray  # all rows of the left-out demonstration

    def parts(self) -> tuple[np.ndarray, ...]:
        """The rows in the order of `PARTS`."""
        return tuple(getattr(self, part) for part in PARTS)


def stream(left_out: int | None) -> int:
    """Index of the random stream of a fold."""
    return 0 if left_out is None else left_out + 1


def leave_one_out(dataset: CouplingDataset, chunk_samples: int, seed: int) -> list[Fold]:
    """One fold per demonstration number; arguments and errors as in `without_generalization`."""
    numbers = np.unique(dataset.demonstration)
    if len(numbers) < 2:
        raise InputError(f"{len(numbers)} demonstration per setting: nothing is left when one is left out")
    return [without_generalization(dataset, chunk_samples, seed, int(number)) for number in numbers]


def without_generalization(
    dataset: CouplingDataset, chunk_samples: int, seed: int, left_out: int | None = None
) -> Fold:
    """Split of all demonstrations except `left_out`; for the final model, of all.

    `dataset`: samples of each demonstration are consecutive in time. `chunk_samples`: number of consecutive
    samples assigned to one part; 1 in the text. Raises InputError: a part would be empty.
    """
    apart = np.full(len(dataset.target), False) if left_out is None else dataset.demonstration == left_out
    chunks = _chunks(dataset, chunk_samples)
    remaining = np.unique(chunks[~apart])
    sizes = [round(fraction * len(remaining)) for fraction in FRACTIONS]
    if min(*sizes, len(remaining) - sum(sizes)) < 1:
        raise InputError(f"{len(remaining)} chunks of samples are too few for train, validation and test")
    shuffled = np.random.default_rng([seed, stream(left_out)]).permutation(remaining)
    validation, test, train = (
        np.flatnonzero(np.isin(chunks, part)) for part in np.split(shuffled, np.cumsum(sizes))
    )
    return Fold(left_out, train, validation, test, generalization=np.flatnonzero(apart))


def _chunks(dataset: CouplingDataset, chunk_samples: int) -> np.ndarray:
    """Chunk number of every sample (S,); no chunk extends past the end of a demonstration."""
    changes = (dataset.setting[1:] != dataset.setting[:-1]) | (np.diff(dataset.demonstration) != 0)
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1])
    rows = np.arange(len(dataset.target))
    within = rows - np.repeat(starts, np.diff([*starts, len(rows)]))
    return np.cumsum(within % chunk_samples == 0) - 1
