"""Supervised data of a feedback model: sensor deviations, phase, and the coupling term that was demonstrated.

One row per sample, keyed by setting and demonstration; the same numbers of a demonstration in different
settings belong together in leave-one-demonstration-out tests. A coupling term of several dimensions is
learned one by one (IV.6.2.3.2): a dataset is of one axis, and those of one primitive differ in their target
alone, so that they share a table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
import pandas as pd

from structlearn.feedback.axes import AXES, Axis
from structlearn.primitives import kernels


@dataclass(frozen=True)
class CouplingDataset:
    """Samples of one primitive in all corrected demonstrations."""

    deviation: np.ndarray  # (S, D) s_actual - s_expected: counts, and N and N m of a wrench
    phase: np.ndarray  # (S,) p
    phase_velocity: np.ndarray  # (S,) u
    target: np.ndarray  # (S,) coupling term of one axis, m or rad
    setting: np.ndarray  # (S,) degrees of board roll, or labels
    demonstration: np.ndarray  # (S,) number of the demonstration within its setting, from 0
    time: np.ndarray  # (S,) s since the primitive's start
    groups: tuple[int, ...] = ()  # numbers of neighbouring channels that share a unit; none: all do

    def modulation(self, kernel_count: int = kernels.KERNEL_COUNT) -> np.ndarray:
        """Phase features G(p, u), (S, N)."""
        return kernels.features(self.phase, self.phase_velocity, kernel_count)

    def where(self, mask: np.ndarray) -> Self:
        """The samples of a mask (S,) or of indices."""
        return replace(self, **{name: getattr(self, name)[mask] for name in COLUMNS})


COLUMNS = tuple(field.name for field in fields(CouplingDataset) if field.name != "groups")
"""What a dataset has of every sample."""


def concatenated(parts: Sequence[CouplingDataset]) -> CouplingDataset:
    """The samples of several datasets of the same channels, one after the other."""
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS
    }
    return replace(parts[0], **columns)


def to_table(dataset: CouplingDataset) -> pd.DataFrame:
    """One row per sample of a dataset with settings in degrees; channels are `channel_00` and so on."""
    keys = {"setting_deg": dataset.setting}
    return pd.DataFrame(keys | _times(dataset) | {"target": dataset.target} | _channels(dataset))


def from_table(table: pd.DataFrame) -> CouplingDataset:
    """The dataset of a table written by `to_table`."""
    return _dataset(table, "setting_deg", "target")


def to_axes_table(datasets: Mapping[Axis, CouplingDataset]) -> pd.DataFrame:
    """One row per sample of what was demonstrated of one primitive on several axes.

    Returns `setting` (a label), `demonstration`, `time_s`, `phase`, `phase_velocity`, `target_<axis>` of each
    axis, and the deviation of each channel: `channel_00`, ... in the first group, in others
    `channel_<group>_00`, ...
    """
    first = next(iter(datasets.values()))
    keys = {"setting": first.setting.astype(str).astype(object)}
    targets = {f"target_{axis}": datasets[axis].target for axis in AXES if axis in datasets}
    return pd.DataFrame(keys | _times(first) | targets | _channels(first))


def from_axes_table(table: pd.DataFrame) -> dict[Axis, CouplingDataset]:
    """The datasets of a table written by `to_axes_table`, by axis.

    Raises KeyError: the table is of another kind.
    """
    axes = [axis for axis in AXES if f"target_{axis}" in table.columns]
    if not axes:
        raise KeyError("target_<axis>")
    one = _dataset(table, "setting", f"target_{axes[0]}")
    return {axis: replace(one, target=table[f"target_{axis}"].to_numpy(float)) for axis in axes}


def _times(dataset: CouplingDataset) -> dict[str, np.ndarray]:
    return {
        "demonstration": dataset.demonstration,
        "time_s": dataset.time,
        "phase": dataset.phase,
        "phase_velocity": dataset.phase_velocity,
    }


def _channels(dataset: CouplingDataset) -> dict[str, np.ndarray]:
    groups = dataset.groups or (dataset.deviation.shape[1],)
    names = [
        f"channel_{f'{group}_' if group else ''}{index:02d}"
        for group, count in enumerate(groups)
        for index in range(count)
    ]
    return dict(zip(names, dataset.deviation.T, strict=True))


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
    )
