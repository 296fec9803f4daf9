"""Supervised data of a feedback model: sensor deviations, phase, and the coupling term that was demonstrated.

One table per primitive, one row per sample, keyed by setting and demonstration; the same numbers of a
demonstration in different settings belong together in leave-one-demonstration-out tests.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import pandas as pd

from structlearn.primitives import kernels


@dataclass(frozen=True)
class CouplingDataset:
    """Samples of one primitive in all corrected demonstrations.

    Attributes:
        deviation: (S, D) s_actual - s_expected, counts.
        phase: (S,) p.
        phase_velocity: (S,) u.
        target: (S,) coupling term of one dimension.
        setting: (S,) degrees of board roll.
        demonstration: (S,) number of the demonstration within its setting, from 0.
        time: (S,) s since the primitive's start.
    """

    deviation: np.ndarray
    phase: np.ndarray
    phase_velocity: np.ndarray
    target: np.ndarray
    setting: np.ndarray
    demonstration: np.ndarray
    time: np.ndarray

    def modulation(self, kernel_count: int = kernels.KERNEL_COUNT) -> np.ndarray:
        """Phase features G(p, u), (S, N)."""
        return kernels.features(self.phase, self.phase_velocity, kernel_count)

    def where(self, mask: np.ndarray) -> Self:
        """The samples of a mask (S,) or of indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def concatenated(parts: Sequence[CouplingDataset]) -> CouplingDataset:
    """The samples of several datasets of the same channels, one after the other."""
    columns = {name: np.concatenate([vars(part)[name] for part in parts]) for name in vars(parts[0])}
    return CouplingDataset(**columns)


def to_table(dataset: CouplingDataset) -> pd.DataFrame:
    """One row per sample; channels are the columns `channel_00`, `channel_01`, ..."""
    columns = {
        "setting_deg": dataset.setting,
        "demonstration": dataset.demonstration,
        "time_s": dataset.time,
        "phase": dataset.phase,
        "phase_velocity": dataset.phase_velocity,
        "target": dataset.target,
    }
    channels = {f"channel_{index:02d}": values for index, values in enumerate(dataset.deviation.T)}
    return pd.DataFrame(columns | channels)


def from_table(table: pd.DataFrame) -> CouplingDataset:
    """The dataset of a table written by `to_table`."""
    channels = [name for name in table.columns if name.startswith("channel_")]
    return CouplingDataset(
        deviation=table[channels].to_numpy(float),
        phase=table["phase"].to_numpy(float),
        phase_velocity=table["phase_velocity"].to_numpy(float),
        target=table["target"].to_numpy(float),
        setting=table["setting_deg"].to_numpy(float),
        demonstration=table["demonstration"].to_numpy(int),
        time=table["time_s"].to_numpy(float),
    )
