"""Cut-point errors over noise and thresholds, and effects of down-sampling, of simulated demonstrators.

Each person is drawn from the population of `simulate` by a seed of the sweep.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Annotated

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.scraping.world.demonstrator import (
    RATE_HZ,
    DemonstratorParameters,
    Intention,
    as_meant,
    intended_movements,
)
from dissertation.simulation.individuals import drawn
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import AS_PRINTED, RESULT
from structlearn.segmentation.cut_errors import cut_errors
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut


class SweepParameters(Parameters):
    """Sweep over noise, thresholds of the crossing and down-sampling."""

    noise_mm: tuple[float, ...] = Field(min_length=1)
    seeds: int = Field(ge=1, le=1000)
    first_seed: int = Field(ge=0)
    downsampling: tuple[int, ...] = Field(min_length=1)
    threshold_factors: tuple[Annotated[float, Field(gt=0)], ...] = Field(min_length=2)

    @property
    def people(self) -> range:
        """Seeds of the simulated people."""
        return range(self.first_seed, self.first_seed + self.seeds)


EFFECT = ["factor", "work", "mean_shift_ms", "max_shift_ms", "shift_samples", "shift_samples_published"]
ERRORS = ["demonstration", "primitive", "method", "start_error_s", "end_error_s"]


def noise_sweep(
    parameters: SweepParameters, simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> pd.DataFrame:
    """Cut errors of all methods at every noise level, for people whose movements are the same at every level.

    People differ in their movements; at a level, all have its noise.

    Returns errors as of `cut_errors`, with `noise_mm` and `seed`. A demonstration that could not be cut has
    one row with method `left_out`; if the reference could not be cut, all have.

    Raises InputError: the segmentation does not fit the simulated task.
    """
    task = len(simulation.durations_s)
    if (count := len(segmentation.primitives)) != task:
        raise InputError(f"segment.primitives: names {count}, the simulated task has {task}")
    tolerant = segmentation.model_copy(update={"skip_failures": True})
    work = partial(_cut_errors, levels=parameters.noise_mm, simulation=simulation, segmentation=tolerant)
    by_person = parallel_map(work, parameters.people, "noise sweep")
    errors = chain.from_iterable(zip(*by_person, strict=True))  # ordered by level
    return pd.concat(errors, ignore_index=True)


def threshold_sweep(
    parameters: SweepParameters, simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> pd.DataFrame:
    """Cut errors of all methods with every threshold of the crossing multiplied by some factors (IV.5).

    The same threshold cuts the reference. Returns errors as of `cut_errors` with `factor` and `seed`, at the
    demonstrator's own noise; demonstrations that could not be cut as of `noise_sweep`.
    """
    tolerant = segmentation.model_copy(update={"skip_failures": True})
    factors = parameters.threshold_factors
    work = partial(_errors_by_threshold, factors=factors, simulation=simulation, segmentation=tolerant)
    return pd.concat(parallel_map(work, parameters.people, "threshold sweep"), ignore_index=True)


def downsampling_sweep(
    parameters: SweepParameters, simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> pd.DataFrame:
    """`cut_errors.downsampling_effect` for every person of the sweep, at the demonstrator's own noise.

    Returns one row per person and factor, with `seed`; none for a person whose reference cannot be cut.
    """
    tolerant = segmentation.model_copy(update={"skip_failures": True})
    factors = parameters.downsampling
    work = partial(_downsampled, factors=factors, simulation=simulation, segmentation=tolerant)
    effects = pd.concat(parallel_map(work, parameters.people, "down-sampling"), ignore_index=True)
    return effects.reindex(columns=["seed", *EFFECT])


def _downsampled(
    seed: int, factors: Sequence[int], simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> pd.DataFrame:
    movements = intended_movements(drawn(simulation, seed))
    try:
        return downsampling_effect(_demonstrated(movements, seed), segmentation, factors).assign(seed=seed)
    except InputError:
        return pd.DataFrame()


def _cut_errors(
    seed: int, levels: Sequence[float], simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> list[pd.DataFrame]:
    """Errors of one person at each level of noise, in place of the person's own."""
    movements = intended_movements(drawn(simulation, seed).model_copy(update={"noise_mm": 1.0}))
    tables = []
    for noise in levels:
        noisy = [
            replace(one, edge_noise=noise * one.edge_noise, tilt_noise=noise * one.tilt_noise)
            for one in movements
        ]
        tables.append(_errors(_demonstrated(noisy, seed), segmentation).assign(noise_mm=noise, seed=seed))
    return tables


def _errors_by_threshold(
    seed: int, factors: Sequence[float], simulation: DemonstratorParameters, segmentation: SegmentParameters
) -> pd.DataFrame:
    """Errors of one person with each threshold."""
    demonstrations = _demonstrated(intended_movements(drawn(simulation, seed)), seed)
    tables = []
    for factor in factors:
        scaled = [
            one.model_copy(update={"threshold_m_s": one.threshold_m_s and factor * one.threshold_m_s})
            for one in segmentation.primitives
        ]
        own = segmentation.model_copy(update={"primitives": tuple(scaled)})
        tables.append(_errors(demonstrations, own).assign(factor=factor, seed=seed))
    return pd.concat(tables, ignore_index=True)


def _errors(demonstrations: Sequence[Demonstration], segmentation: SegmentParameters) -> pd.DataFrame:
    """`cut_errors`, and a row with method `left_out` for each demonstration that could not be cut."""
    try:
        cuts = cut(demonstrations, segmentation)
        found, left_out = [cut_errors(demonstrations, cuts)], cuts.left_out["demonstration"]
    except InputError:  # the reference could not be cut, so none can
        found, left_out = [], [demonstration.name for demonstration in demonstrations]
    missing = pd.DataFrame({"demonstration": left_out, "method": "left_out"})
    return pd.concat([*found, missing], ignore_index=True).reindex(columns=ERRORS)


def _demonstrated(movements: Sequence[Intention], seed: int) -> list[Demonstration]:
    return [synchronise(as_meant(movement, seed), RATE_HZ) for movement in movements]


def downsampling_effect(
    demonstrations: Sequence[Demonstration], parameters: SegmentParameters, factors: Sequence[int]
) -> pd.DataFrame:
    """Effect of down-sampling the alignment by several factors on the cut points (appendix C).

    `parameters`: of the segmentation; `downsampling` is replaced. Returns one row per factor: `factor`,
    `work` (cells of the warping tables relative to the first factor; `make bench` times them),
    `mean_shift_ms` and `max_shift_ms` of the cut points against the first factor's, and the largest shift in
    aligned samples: `shift_samples`, and `shift_samples_published` for weighted least squares as printed.
    """
    segmentations = {
        factor: cut(demonstrations, parameters.model_copy(update={"downsampling": factor}))
        for factor in factors
    }
    keys, first = ["method", "demonstration", "primitive"], segmentations[factors[0]]
    rows = []
    for factor, segmentation in segmentations.items():
        ends = [cut.cuts.set_index(keys)[["start_s", "end_s"]] for cut in (segmentation, first)]
        shifts = (ends[0] - ends[1]).dropna().abs()  # demonstrations that both could cut
        shift, as_printed = (shifts.loc[method].to_numpy() for method in (RESULT, AS_PRINTED))
        in_ms, samples = 1e3 * np.array([shift.mean(), shift.max()]), factor * demonstrations[0].dt
        in_samples = shift.max() / samples, as_printed.max() / samples
        rows.append((factor, segmentation.cells / first.cells, *in_ms, *in_samples))
    return pd.DataFrame(rows, columns=EFFECT)
