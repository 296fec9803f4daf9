"""Latent spaces of recorded touch, and what carries over between simulated and recorded touch (II.4).

Three sets: slides of a BioTac over materials, logs of unscrewing with another one, and simulated touches of
a handle; a recorded set may be missing. The same code learns from each; whole trials are left out. Then what
was learned from one set is tested on another, each standardised by itself, with principal components as the
simple rival.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.latent_comparison import learn_spaces, own_units, seen_in
from structlearn.tactile.latent_evaluation import latent_errors
from structlearn.tactile.latent_parameters import LatentSpaceParameters
from structlearn.tactile.touch_dataset import TEST, TRAIN
from structlearn.tasks.public.protocol.touch_sets import (
    PARTNERS,
    RECORDED,
    LatentTouchParameters,
    TouchSet,
)
from structlearn.tasks.public.protocol.touch_statistics import variance_shares

if TYPE_CHECKING:
    from sklearn.decomposition import PCA

LEARNED, NEW_TRIALS, NEW_MATERIAL, NEW_SET = "learned from", "new trials", "new material", "new set"
OWN_UNITS = "new material, standardised by itself"
"""What is new in the samples that are tested on; a new set is always standardised by itself."""

STRUCTURED, PLAIN, COMPONENTS = "structured", "reconstruction only", "3 principal components"
MODELS = (STRUCTURED, PLAIN, COMPONENTS)
"""Autoencoders with and without the losses of map and pressure, and the rival."""

DIMENSIONS = 3
"""Of the latent space; as many principal components has the rival."""


@dataclass(frozen=True)
class LatentTouchResults:
    """What the sets show.

    Attributes:
        errors: per `learned_from` and `asked_about` (sets), `new` (what is new in the samples), `part` (its
            number), `model` and `seed`: NMSE of `reconstruction` (mean over electrodes), of its
            `worst_electrode`, of map `distances` and of `pressure`. The last two are NaN for principal
            components.
        sets: per `set`: `trials`, `samples`, `counts` (root mean square over electrodes of their standard
            deviations), `against` (share of changes against the pressure), `start_counts` and `end_counts`
            (mean pressure of the trials at their start and end), `components` (principal components that
            hold 99 % of the standardised variance), `along_mm` and `across_mm` (mean place of the contact
            points on the skin), `along_std_mm` and `across_std_mm`.
        likeness: per `first` and `second`: `correlation` of the off-diagonal elements of their electrodes'
            correlation matrices. A set beside itself: mean over pairs of its groups.
        correlations: these matrices: `set`, `electrode`, `other`, `correlation`.
    """

    errors: pd.DataFrame
    sets: pd.DataFrame
    likeness: pd.DataFrame
    correlations: pd.DataFrame


def learn_touch(
    sets: Sequence[TouchSet], skin: Skin, parameters: LatentTouchParameters
) -> LatentTouchResults:
    """Learn from every set, and ask about what was left out and about its partner.

    Of the simulated sets only the first part of the trials is left out.

    Raises:
        InputError: a set has a single trial, or an electrode of it never changes.
    """
    by_name = {one.name: one for one in sets}
    work = [
        (one, by_name[PARTNERS[one.name]], new, part, trials, parameters.spaces)
        for one in sets
        for new, parts in left_out(one, parameters.folds).items()
        for part, trials in enumerate(parts)
        if part == 0 or one.name in RECORDED  # simulated trials are many, and like each other
    ]
    tables = parallel_map(_errors, work, "latent spaces of touch", local=True)
    return LatentTouchResults(
        errors=pd.concat(tables, ignore_index=True),
        sets=pd.DataFrame([_statistics(one, skin) for one in sets]),
        likeness=_likeness(by_name),
        correlations=pd.concat([_correlation_table(one) for one in sets], ignore_index=True),
    )


def left_out(touches: TouchSet, folds: int) -> dict[str, list[np.ndarray]]:
    """Trials that are left out in turn, by what is new: whole trials, or a group that has several.

    Raises:
        InputError: there is a single trial.
    """
    groups = np.array(touches.groups)
    trials = np.arange(len(groups))
    if len(trials) < 2:
        raise InputError(f"{touches.name}: of a single trial none can be left out")
    count = min(folds, len(trials))
    found = {NEW_TRIALS: [trials[part::count] for part in range(count)]}
    names = dict.fromkeys(touches.groups)
    if 1 < len(names) < len(trials):
        found[NEW_MATERIAL] = [trials[groups == name] for name in names]
    return found


def _errors(
    work: tuple[TouchSet, TouchSet, str, int, np.ndarray, LatentSpaceParameters],
) -> pd.DataFrame:
    """Errors of all models that learned from one part of a set."""
    from sklearn.decomposition import PCA

    source, partner, new, part, trials, parameters = work
    samples = source.without(trials)
    units = own_units(samples, source.geodesics)
    models = learn_spaces(samples, source.geodesics, units, parameters)
    asked = {LEARNED: (units, samples, source, TRAIN), new: (units, samples, source, TEST)}
    if new == NEW_MATERIAL:
        rest = source.without(np.setdiff1d(np.arange(len(source.groups)), trials))
        asked[OWN_UNITS] = (own_units(rest, source.geodesics), rest, source, TRAIN)
    else:
        whole = partner.without(())
        asked[NEW_SET] = (own_units(whole, partner.geodesics), whole, partner, TRAIN)
    seen = {
        name: seen_in(its_units, touches, of.geodesics, split, parameters.evaluation_pairs)
        for name, (its_units, touches, of, split) in asked.items()
    }
    spaces = latent_errors(models, seen).rename(columns={"split": "new"})
    spaces["model"] = np.where(spaces.pop("structure"), STRUCTURED, PLAIN)
    components = PCA(DIMENSIONS).fit(seen[LEARNED].signals.numpy())
    rival = pd.DataFrame(
        {"new": name, "model": COMPONENTS, "seed": 0, **_component_errors(components, data.signals.numpy())}
        for name, data in seen.items()
    )
    table = pd.concat([spaces, rival], ignore_index=True)
    if new == NEW_MATERIAL:  # its errors on what it learned from tell nothing more than those of `NEW_TRIALS`
        table = table[table["new"] != LEARNED]
    about = table["new"].map({name: of.name for name, (_, _, of, _) in asked.items()})
    return table.assign(learned_from=source.name, asked_about=about, part=part)


def _component_errors(components: "PCA", seen: np.ndarray) -> dict[str, float]:
    errors = nmse(components.inverse_transform(components.transform(seen)), seen)
    return {"reconstruction": errors.mean(), "worst_electrode": errors.max()}


def _statistics(touches: TouchSet, skin: Skin) -> dict[str, float | str]:
    samples = touches.samples
    along, across = skin.coordinates(samples.contact_point.astype(float))
    starts = np.flatnonzero(np.diff(samples.trial, prepend=-1))
    ends = np.append(starts[1:], len(samples)) - 1
    deviation = samples.signals.std(axis=0, dtype=float)
    shares = variance_shares(samples.signals / deviation)
    return {
        "set": touches.name,
        "trials": len(touches.groups),
        "samples": len(samples),
        "counts": np.sqrt(np.mean(deviation**2)),
        "against": np.mean(samples.signals > 0),
        "start_counts": samples.pressure[starts].mean(dtype=float),
        "end_counts": samples.pressure[ends].mean(dtype=float),
        "components": int(np.searchsorted(np.cumsum(shares), 0.99) + 1),
        "along_mm": 1e3 * along.mean(),
        "across_mm": 1e3 * across.mean(),
        "along_std_mm": 1e3 * along.std(),
        "across_std_mm": 1e3 * across.std(),
    }


def _likeness(by_name: Mapping[str, TouchSet]) -> pd.DataFrame:
    rows, recorded = [], [name for name in RECORDED if name in by_name]
    for name in recorded:
        touches = by_name[name]
        groups = np.array(touches.groups)[touches.samples.trial]
        matrices = [
            np.corrcoef(touches.samples.signals[groups == its].T) for its in dict.fromkeys(touches.groups)
        ]
        alike = [_alike(*pair) for pair in combinations(matrices, 2)]
        if alike:
            rows.append({"first": name, "second": name, "correlation": np.mean(alike)})
    for name in recorded:
        pair = name, PARTNERS[name]
        matrices = [np.corrcoef(by_name[its].samples.signals.T) for its in pair]
        rows.append({"first": pair[0], "second": pair[1], "correlation": _alike(*matrices)})
    return pd.DataFrame(rows)


def _alike(first: np.ndarray, second: np.ndarray) -> float:
    upper = np.triu_indices(len(first), k=1)
    return float(np.corrcoef(first[upper], second[upper])[0, 1])


def _correlation_table(touches: TouchSet) -> pd.DataFrame:
    matrix = np.corrcoef(touches.samples.signals.T)
    electrodes = np.arange(1, len(matrix) + 1)
    return pd.DataFrame(
        {
            "set": touches.name,
            "electrode": np.repeat(electrodes, len(electrodes)),
            "other": np.tile(electrodes, len(electrodes)),
            "correlation": matrix.ravel(),
        }
    )
