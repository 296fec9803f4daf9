"""Corrected demonstrations as paths, and the error of the path that a feedback model unrolls.

    r = R c        error = rms (R c - r_cd)

A primitive with c_target as its coupling term reproduces the demonstration (`coupling`), so r_cd follows from
the coupling dataset. `training.pmnn` trains a network to follow such paths.

The transformation system is linear in c, so a coupling term (held over each step) adds a sum of responses to
a movement. These depend on dt / tau alone: with T samples in normalised time, all movements share one matrix,
whatever their durations; those of a rhythmic primitive, one for each number of cycles.

For positions, and for rotations about one fixed axis, this is exact. Otherwise rotations do not commute: a
correction of 10 degrees about a fixed axis, on top of a nominal movement of 1, 4 and 10 degrees about other
axes, differs from `primitives.orientation.unroll` by less than 0.001, 0.02 and 0.1 degrees; corrections of 2,
5 and 10 degrees about two axes at once by less than 0.15, 0.35 and 0.7 degrees. This is below the error of
feedback models, so there is no sequential unroll on SO(3) here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
import pandas as pd
from scipy.linalg import toeplitz

from structlearn.core.errors import InputError
from structlearn.core.signals import time_normalised
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.primitives import canonical, rhythmic, transformation
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.transformation import ALPHA, BETA, step_matrix
from structlearn.readers.source import setting_label

PHASE_TOLERANCE = 0.02
"""Largest difference of a demonstration's phase from that of a uniform movement from start to end."""

SAMPLES = 250
"""Samples per demonstration in normalised time: about 100 Hz, the electrodes' rate, in movements of 2.6 s."""


@dataclass(frozen=True)
class CorrectedPaths:
    """Corrected demonstrations of one primitive at the same T samples of normalised time."""

    deviation: np.ndarray  # (L, T, D) s_actual - s_expected, counts
    target: np.ndarray  # (L, T) demonstrated coupling term of one axis, m or rad
    # (L, T) m or rad, offset added to the nominal movement from the demonstration's initial state
    correction: np.ndarray
    setting: np.ndarray  # (L,) degrees of board roll, or labels
    demonstration: np.ndarray  # (L,) number within the setting
    rhythms: np.ndarray  # (L, 2) `Rhythm` of each, NaN of a discrete primitive

    @property
    def response(self) -> np.ndarray:
        """Response matrix (T, T), or (L, T, T) of strokes: shift or rotation over time per coupling term."""
        samples = self.target.shape[1]
        if self._is_discrete:
            return coupling_response(samples, _step(samples))
        return np.array([coupling_response(samples, _step(samples, Rhythm(*each))) for each in self.rhythms])

    @property
    def phase(self) -> tuple[np.ndarray, np.ndarray]:
        """Phase and phase velocity of the samples: (T,), or (L, T) of strokes."""
        samples = self.target.shape[1]
        if self._is_discrete:
            return canonical.phase(_step(samples) * np.arange(samples), 1.0)
        shares = np.linspace(0.0, 1.0, samples)
        phases = [rhythmic.phase(each[1] * shares, Rhythm(*each)) for each in self.rhythms]
        p, u = np.moveaxis(np.array(phases), 1, 0)
        return p, u

    def displacement(self, network: CouplingModel) -> np.ndarray:
        """Offset (L, T), m or rad, that a network's coupling terms add, given the recorded sensors."""
        terms, response = network.coupling(self.deviation, *self.phase), self.response
        return terms @ response.T if self._is_discrete else (response @ terms[..., None])[..., 0]

    @property
    def _is_discrete(self) -> bool:
        return bool(np.isnan(self.rhythms).any())

    def where(self, mask: np.ndarray) -> Self:
        """Demonstrations selected by a mask (L,) or by indices."""
        return type(self)(**{name: values[mask] for name, values in vars(self).items()})


def corrected_paths(dataset: CouplingDataset, samples: int) -> CorrectedPaths:
    """Demonstrations of a coupling dataset in normalised time, sorted by setting, then demonstration.

    The correction is unrolled at the demonstration's own rate, so that nothing aliases; everything is then
    interpolated linearly. Raises InputError: a demonstration is not on a uniform clock from the start to the
    end of the primitive.
    """
    keys = sorted(set(zip(dataset.setting.tolist(), dataset.demonstration.tolist(), strict=True)))
    normalised, rhythms = [], []
    for setting, number in keys:
        chosen = np.flatnonzero((dataset.setting == setting) & (dataset.demonstration == number))
        rows = dataset.where(chosen[np.argsort(dataset.time[chosen], kind="stable")])
        _check_whole_movement(rows, f"setting {setting_label(setting)}, demonstration {number}")
        rhythms.append(None if rows.cycle is None else Rhythm(rows.cycle[0], float(np.ptp(rows.cycle))))
        columns = np.column_stack([rows.target, _correction(rows.target, rhythms[-1]), rows.deviation])
        normalised.append(time_normalised(columns, samples))
    paths = np.array(normalised)  # (L, T, 2 + D)
    return CorrectedPaths(
        deviation=paths[..., 2:],
        target=paths[..., 0],
        correction=paths[..., 1],
        setting=np.array([setting for setting, _ in keys]),
        demonstration=np.array([number for _, number in keys]),
        rhythms=np.array([rhythm or (np.nan, np.nan) for rhythm in rhythms]),
    )


def unrolled_error(network: CouplingModel, paths: CorrectedPaths) -> np.ndarray:
    """RMS distance (L,), m or rad, between unrolled and demonstrated path, given the recorded sensors."""
    return np.sqrt(np.mean((paths.displacement(network) - paths.correction) ** 2, axis=1))


def path_errors(
    datasets: Mapping[str, CouplingDataset], models: Mapping[str, Mapping[str, CouplingModel]]
) -> pd.DataFrame:
    """`unrolled_error` of roll paths: `model`, `primitive`, `setting_deg`, `demonstration`, `error_deg`.

    `datasets`: by primitive, with settings that were learned from and others. `models`: networks by
    primitive, by model.
    """
    tables = []
    for name, dataset in datasets.items():
        paths = corrected_paths(dataset, SAMPLES)
        for model, networks in models.items():
            columns = {"model": model, "primitive": name, "setting_deg": paths.setting}
            columns |= {"demonstration": paths.demonstration}
            errors = np.degrees(unrolled_error(networks[name], paths))
            tables.append(pd.DataFrame(columns | {"error_deg": errors}))
    return pd.concat(tables, ignore_index=True)


def split_demonstrations(
    paths: CorrectedPaths, share: float, seed: int
) -> tuple[CorrectedPaths, CorrectedPaths]:
    """Split into training and validation demonstrations, disjoint in demonstration numbers.

    `share`: of the numbers for validation, at least one. Raises InputError: there is only one number.
    """
    numbers = np.unique(paths.demonstration)
    if len(numbers) < 2:
        raise InputError(
            "training in the unroll needs at least two demonstration numbers, one to validate on"
        )
    count = min(max(1, round(share * len(numbers))), len(numbers) - 1)
    chosen = np.random.default_rng(seed).choice(numbers, count, replace=False)
    validated = np.isin(paths.demonstration, chosen)
    return paths.where(~validated), paths.where(validated)


@lru_cache(maxsize=16)
def coupling_response(samples: int, step: float) -> np.ndarray:
    """Response of the transformation system to a coupling term, from the powers of its exact step.

    A path with coupling equals the path without, from the same initial position, velocity and acceleration,
    plus `coupling_response @ c`. Held terms act through c_k -> x_t = (A^(t-k-1) b)_x, a lower-triangular
    Toeplitz matrix; the initial goal compensates the first value (eq. IV.12).

    `samples`: number of samples T from the start. `step`: sampling interval / tau, dimensionless; 1 / (2
    (T - 1)) for a whole movement. Returns (T, T), read-only.
    """
    matrix = step_matrix(step)
    state = np.empty((samples, 3))  # response to the initial state (x - G, tau xd, g - G)
    row = np.array([1.0, 0.0, 0.0])
    for k in range(samples):  # row of A^k that yields x
        state[k] = row
        row = row @ matrix[:, :3]
    impulse = np.zeros(samples)  # response to a held value one step later
    impulse[1:] = (state[:-1] @ matrix[:, 3:])[:, 0]
    response = toeplitz(impulse, np.zeros(samples))
    response[:, 0] -= state[:, 2] / (ALPHA * BETA)
    response.flags.writeable = False
    return response


def _correction(target: np.ndarray, rhythm: Rhythm | None) -> np.ndarray:
    """Offset (T, 1) in m or rad that a coupling target (T,), linear between samples, adds to a movement."""
    step = _step(len(target), rhythm)
    return transformation.unroll(np.zeros(1), np.zeros(1), target[:, None], step, 1.0).position


def _step(samples: int, rhythm: Rhythm | None = None) -> float:
    """Dimensionless step dt / tau of a whole movement with this many samples."""
    if rhythm is not None:
        return rhythm.cycles / (samples - 1)
    return 1.0 / (canonical.TAU_PER_DURATION * (samples - 1))


def _check_whole_movement(rows: CouplingDataset, name: str) -> None:
    progress = np.linspace(0.0, 1.0, len(rows.phase))
    if rows.cycle is None:
        found, (expected, _) = rows.phase, canonical.phase(progress, canonical.TAU_PER_DURATION)
    else:
        found, expected = rows.cycle, rows.cycle[0] + progress * np.ptp(rows.cycle)
    if len(rows.phase) < 3 or np.abs(found - expected).max() > PHASE_TOLERANCE:
        raise InputError(f"{name}: not on a uniform clock from the start to the end of the primitive")
