"""Recorded human reaches: found again between rests, and learned as one primitive."""

from collections.abc import Sequence
from functools import partial

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground import signals
from structlearn.ground.parallel import parallel_map
from structlearn.ground.params import Parameters
from structlearn.primitives.fitting import (
    FitParameters,
    Segment,
    learn_primitive,
    reproduction_errors,
    segment_paths,
    whole,
)
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.cut_errors import Dwells, between_dwells, cut_errors
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut


class ReachParameters(Parameters):
    """Parameters of the reach protocols."""

    segment: SegmentParameters
    fit: FitParameters
    noise_mm: tuple[float, ...] = Field(min_length=1)
    noise_hz: float = Field(gt=0)
    rest_s: tuple[float, float]
    seeds: int = Field(ge=1)
    fold: int = Field(ge=1)


def reach_cut_errors(demonstrations: Sequence[Demonstration], parameters: ReachParameters) -> pd.DataFrame:
    """Errors of the cuts of reaches that were set between random rests with smooth noise.

    The first reach, treated in the same way, is the reference. Rests are the same at every noise level.

    Args:
        demonstrations: the bare reaches.
        parameters: see there.

    Returns:
        Rows of `cut_errors` with `noise_mm` and `seed`.
    """
    work = [(noise, seed) for noise in parameters.noise_mm for seed in range(parameters.seeds)]
    find = partial(_find_again, demonstrations=demonstrations, parameters=parameters)
    return pd.concat(parallel_map(find, work, "reaches between rests"), ignore_index=True)


def _find_again(
    level: tuple[float, int], demonstrations: Sequence[Demonstration], parameters: ReachParameters
) -> pd.DataFrame:
    noise, seed = level
    dwells = Dwells(*parameters.rest_s, parameters.noise_hz)
    embedded = [
        between_dwells(demonstration, dwells, 1e-3 * noise, np.random.default_rng([seed, place]))
        for place, demonstration in enumerate(demonstrations)
    ]
    errors = cut_errors(embedded, cut(embedded, parameters.segment))
    return errors.assign(noise_mm=noise, seed=seed)


def learn_reaches(
    demonstrations: Sequence[Demonstration], parameters: ReachParameters
) -> tuple[PosePrimitive, pd.DataFrame]:
    """One primitive from all reaches, and its distance from each, also from those that were left out.

    Args:
        demonstrations: the bare reaches, at least two.
        parameters: see there.

    Returns:
        The primitive, and rows of `reproduction_errors` with `demonstration` and `variant`: `learned from`,
        `left out` (of the fold that was not learned from) and `learned from, forcing not scaled`.
    """
    segments = segment_paths(demonstrations, whole(demonstrations), parameters.fit.smoothing_hz)
    names = [demonstration.name for demonstration in demonstrations]
    primitive = learn_primitive("reach", segments, parameters.fit)
    plain = learn_primitive(
        "reach", segments, parameters.fit.model_copy(update={"scaled_axes": (False, False, False)})
    )
    folds, size = [], min(parameters.fold, len(segments) // 2)
    for first in range(0, len(segments), size):
        fold = slice(first, first + size)
        unseen = learn_primitive("reach", [*segments[:first], *segments[fold.stop :]], parameters.fit)
        folds.append(reproduction_errors(unseen, segments[fold]).assign(demonstration=names[fold]))
    errors = {
        "learned from": reproduction_errors(primitive, segments).assign(demonstration=names),
        "left out": pd.concat(folds),
        "learned from, forcing not scaled": reproduction_errors(plain, segments).assign(demonstration=names),
    }
    tables = [table.assign(variant=variant) for variant, table in errors.items()]
    return primitive, pd.concat(tables, ignore_index=True)


def own_spread_mm(segments: Sequence[Segment]) -> float:
    """Mean distance in mm of the demonstrations from their own mean, in local frame and normalised time."""
    curves = [
        signals.time_normalised(in_local_frame(position, "up").position, 500) for position, _ in segments
    ]
    return 1e3 * float(np.linalg.norm(curves - np.mean(curves, axis=0), axis=2).mean())
