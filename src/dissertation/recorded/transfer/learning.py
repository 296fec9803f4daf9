"""Latent spaces of recorded touch, and transfer between simulated and recorded touch (II.4).

Sets of BioTac touches, slides over materials and logs of unscrewing, are compared with simulated touches of a
handle. The same code learns from each set and is tested on whole trials held out. Models of one set are then
tested on its partner, with each set standardised by its own statistics and principal components as baseline.

Counts differ in meaning. In the logs of unscrewing they rise under pressure (their mean correlates with the
contact force at 0.98 and more), so their sign is inverted. The slides were published as magnitudes of change,
none below zero: the direction of a change is lost, so each electrode counts as pressed, and magnitudes are
compared with magnitudes.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.recorded.calibration.touch_calibration import in_sets, pca_dimensions
from dissertation.recorded.transfer.parameters import TransferParameters
from dissertation.simulation import fingers, touch_demonstrator
from dissertation.simulation.touch import FingerParameters, TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters, demonstrate
from structlearn.core import signals
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.metrics import nmse
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import stage_parameters
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration, Recording, read_streams
from structlearn.tactile.electrodes import SKINS, Skin
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_comparison import latent_errors, split_data
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters
from structlearn.tactile.latent_training import learn_spaces, own_units
from structlearn.tactile.touch_dataset import (
    OTHER,
    TEST,
    TRAIN,
    TouchDataParameters,
    TouchDataset,
    contact_points,
    motion_of,
    prepare,
)
from structlearn.tasks.task_files import TaskFiles, write_tables
from structlearn.tasks.touch import touch_names as names
from structlearn.tasks.touch.touch_names import NEW_MATERIAL, PARTNERS, SLIDES, UNSCREWING, material_of

LEARNED = "learned from"
RECORDED = (SLIDES, UNSCREWING)
SIMULATED = Path("../../params.yaml")  # of the simulated person and finger, from the project of public sets
DIMENSIONS = 3  # of the latent space; the rival has as many principal components


@dataclass(frozen=True)
class TouchSet:
    """Touches of one origin, with what was touched in each trial; the split of the samples is not used."""

    name: str
    samples: TouchDataset
    geodesics: Geodesics
    groups: tuple[str, ...]

    def without(self, trials: Sequence[int] | np.ndarray) -> TouchDataset:
        """Samples with the given trials as test split and all others as training split."""
        return replace(self.samples, split=np.where(np.isin(self.samples.trial, trials), TEST, TRAIN))


def held_touch(demonstrations: Sequence[Demonstration], skin: Skin, cutoff_hz: float) -> TouchDataset:
    """Samples of trials in contact from start to end; every trial is one contact."""
    parts = [
        motion_of(one, one.dt, cutoff_hz)
        | {"signals": -signals.low_pass(one.signal("tactile"), one.dt, cutoff_hz), "time": one.time}
        for one in demonstrations
    ]
    found = {name: np.concatenate([one[name] for one in parts]).astype(np.float32) for name in parts[0]}
    trial = np.repeat(np.arange(len(demonstrations)), [len(one.time) for one in demonstrations])
    return TouchDataset(
        **found,
        pressure=-found["signals"].mean(axis=1),
        contact_point=contact_points(found["signals"], skin).astype(np.float32),
        contact=trial,
        trial=trial,
        pressed=np.full(len(trial), True),
        motion=np.full(len(trial), OTHER),
        split=np.full(len(trial), TRAIN),
        rate_hz=np.array(1 / demonstrations[0].dt),
    )


def magnitudes(samples: TouchDataset, skin: Skin) -> TouchDataset:
    """Samples without the sign of the changes: every electrode counts as pressed."""
    found = -np.abs(samples.signals)
    points = contact_points(found, skin).astype(np.float32)
    return replace(samples, signals=found, pressure=-found.mean(axis=1), contact_point=points)


def touch_sets(
    recorded: Mapping[str, Sequence[Demonstration]],
    simulated: TouchDataset,
    skin: Skin,
    cutoff_hz: float,
    left_out: Collection[str],
    parameters: GeodesicParameters,
) -> list[TouchSet]:
    """Recorded sets with several trials and their simulated partners, with distances on the skin.

    A set is skipped with its partner if it has too few samples for distances, or patches too far apart.
    Raises MissingInputError if no set is left.
    """
    found = {}
    for name, trials in recorded.items():
        sound = [one for one in trials if one.name not in left_out]
        if len(sound) > 1:
            groups = [material_of(one.name) if name == SLIDES else one.name for one in sound]
            found[name] = held_touch(sound, skin, cutoff_hz), groups
    handle = ["handle"] * (int(simulated.trial.max()) + 1)
    found[names.SIMULATED] = simulated, handle
    found[names.MAGNITUDES] = magnitudes(simulated, skin), handle
    sets = {}
    for name, (samples, groups) in found.items():
        try:
            distances = geodesics(samples.contact_point, parameters)
        except MissingInputError as missing:
            print(f"latent touch: {name} left aside: {missing}")
        else:
            sets[name] = TouchSet(name, samples, distances, tuple(groups))
    paired = [its for name, its in sets.items() if PARTNERS[name] in sets]
    if not paired:
        raise MissingInputError("there are no two slides or logs of unscrewing whose touches make a map")
    return paired


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `learn_transfer`."""
    electrodes = stage_parameters("testbed.touch", fingers.PinchParameters, SIMULATED)
    found = compare_sets(
        read_streams(files.recorded / "streams.parquet"),
        files.entry(TransferParameters),
        stage_parameters("toucher", ToucherParameters, SIMULATED),
        stage_parameters("touch_finger", TouchFingerParameters, SIMULATED).with_electrodes_of(electrodes),
        stage_parameters("touch_dataset", TouchDataParameters, SIMULATED),
    )
    write_tables(found, folder)


def compare_sets(
    recordings: Sequence[Recording],
    parameters: TransferParameters,
    person: ToucherParameters,
    finger: FingerParameters,
    samples: TouchDataParameters,
) -> dict[str, pd.DataFrame]:
    """Compare recorded sets with touches by a simulated person; see `learn_transfer`."""
    skin = SKINS["biotac"]
    recorded = {
        name: [synchronise(one, samples.rate_hz) for one in its]
        for name, its in in_sets(recordings).items()
        if name in RECORDED
    }
    if max(map(len, recorded.values()), default=0) < 2:
        raise MissingInputError("two slides or two logs of unscrewing are needed")
    fewer = dict.fromkeys(("rotations", "translations"), parameters.simulated_repeats) | {"skin": skin.name}
    person = person.model_copy(update=fewer)
    simulated = [touch_demonstrator.recorded(one, person) for one in demonstrate(person, finger)]
    touches = prepare([synchronise(one, samples.rate_hz) for one in simulated], skin, samples)
    sets = touch_sets(recorded, touches, skin, samples.cutoff_hz, parameters.left_out, parameters.geodesics)
    return learn_transfer(sets, skin, parameters)


def learn_transfer(
    sets: Sequence[TouchSet], skin: Skin, parameters: TransferParameters
) -> dict[str, pd.DataFrame]:
    """Learn from every set, and test on the trials held out and on the partner set.

    Trials of a simulated set are many and alike, so only their first part is held out.

    Returns:
        `errors` per `learned_from` and `test_run` (sets), `new` (what is new in the samples), `part` (its
        number), `model` and `seed`: NMSE of `reconstruction` (mean over electrodes), of its
        `worst_electrode`, of map `distances` and of `pressure`; the last two are NaN for components.
        `sets`: see `_statistics`. `likeness` per `first` and `second`: `correlation` of the off-diagonal
        elements of their electrodes' correlation matrices; of a set with itself, mean over pairs of its
        groups. `correlations`, these matrices: `set`, `electrode`, `other`, `correlation`.

    Raises:
        InputError: a set has a single trial, or an electrode of it never changes.
    """
    by_name = {one.name: one for one in sets}
    work = [
        (one, by_name[PARTNERS[one.name]], new, part, trials, parameters.spaces)
        for one in sets
        for new, parts in parts_left_out(one, parameters.folds).items()
        for part, trials in enumerate(parts)
        if part == 0 or one.name in RECORDED
    ]
    tables = parallel_map(_errors, work, "latent spaces of touch", local=True)
    likeness, correlations = _correlations(by_name)
    return {
        "errors": pd.concat(tables, ignore_index=True),
        "sets": pd.DataFrame([_statistics(one, skin) for one in sets]),
        "likeness": likeness,
        "correlations": correlations,
    }


def parts_left_out(touches: TouchSet, folds: int) -> dict[str, list[np.ndarray]]:
    """Trials left out in turn, keyed by what is new: whole trials, or a group that has several."""
    groups = np.array(touches.groups)
    trials = np.arange(len(groups))
    if len(trials) < 2:
        raise InputError(f"{touches.name}: of a single trial none can be left out")
    count = min(folds, len(trials))
    found = {names.NEW_TRIALS: [trials[part::count] for part in range(count)]}
    materials = dict.fromkeys(touches.groups)
    if 1 < len(materials) < len(trials):
        found[NEW_MATERIAL] = [trials[groups == name] for name in materials]
    return found


def _errors(
    work: tuple[TouchSet, TouchSet, str, int, np.ndarray, LatentSpaceParameters],
) -> pd.DataFrame:
    """Errors of all models learned from a set without one part of its trials."""
    from sklearn.decomposition import PCA

    source, partner, new, part, trials, parameters = work
    samples = source.without(trials)
    units = own_units(samples, source.geodesics)
    models = learn_spaces(samples, source.geodesics, units, parameters)
    tests = {LEARNED: (units, samples, source, TRAIN), new: (units, samples, source, TEST)}
    if new == NEW_MATERIAL:
        rest = source.without(np.setdiff1d(np.arange(len(source.groups)), trials))
        tests[names.OWN_UNITS] = (own_units(rest, source.geodesics), rest, source, TRAIN)
    else:
        whole = partner.without(())
        tests[names.NEW_SET] = (own_units(whole, partner.geodesics), whole, partner, TRAIN)
    pairs = parameters.evaluation_pairs
    seen = {
        name: split_data(its_units, touches, of.geodesics, split, pairs, np.random.default_rng(split))
        for name, (its_units, touches, of, split) in tests.items()
    }
    spaces = latent_errors(models, seen).rename(columns={"split": "new"})
    spaces["model"] = np.where(spaces.pop("structure"), names.STRUCTURED, names.PLAIN)
    components, rival = PCA(DIMENSIONS).fit(seen[LEARNED].signals.numpy()), []
    for name, data in seen.items():
        its = data.signals.numpy()
        errors = nmse(components.inverse_transform(components.transform(its)), its)
        rival.append((name, names.COMPONENTS, 0, errors.mean(), errors.max()))
    columns = ["new", "model", "seed", "reconstruction", "worst_electrode"]
    table = pd.concat([spaces, pd.DataFrame(rival, columns=columns)], ignore_index=True)
    if new == NEW_MATERIAL:  # training errors add nothing to those of `NEW_TRIALS`
        table = table[table["new"] != LEARNED]
    about = table["new"].map({name: of.name for name, (_, _, of, _) in tests.items()})
    return table.assign(learned_from=source.name, test_run=about, part=part)


def _statistics(touches: TouchSet, skin: Skin) -> dict[str, float | str]:
    """Row of `sets`; their columns are explained on the page."""
    samples = touches.samples
    along, across = skin.coordinates(samples.contact_point.astype(float))
    starts = np.flatnonzero(np.diff(samples.trial, prepend=-1))
    ends = np.append(starts[1:], len(samples)) - 1
    deviation = samples.signals.std(axis=0, dtype=float)
    return {
        "set": touches.name,
        "trials": len(touches.groups),
        "samples": len(samples),
        "counts": np.sqrt(np.mean(deviation**2)),
        "against": np.mean(samples.signals > 0),
        "start_counts": samples.pressure[starts].mean(dtype=float),
        "end_counts": samples.pressure[ends].mean(dtype=float),
        "components": pca_dimensions(samples.signals / deviation, 0.99),
        "along_mm": 1e3 * along.mean(),
        "across_mm": 1e3 * across.mean(),
        "along_std_mm": 1e3 * along.std(),
        "across_std_mm": 1e3 * across.std(),
    }


def _correlations(by_name: Mapping[str, TouchSet]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """`likeness` and `correlations` of `learn_transfer`."""
    whole = {name: np.corrcoef(its.samples.signals.T) for name, its in by_name.items()}
    recorded = [name for name in RECORDED if name in by_name]
    likeness = []
    for name in recorded:
        touches, group = by_name[name].samples, np.array(by_name[name].groups)
        matrices = [np.corrcoef(touches.signals[(group == its)[touches.trial]].T) for its in pd.unique(group)]
        if len(matrices) > 1:
            alike = [_alike(*pair) for pair in combinations(matrices, 2)]
            likeness.append((name, name, float(np.mean(alike))))
    likeness += [(name, PARTNERS[name], _alike(whole[name], whole[PARTNERS[name]])) for name in recorded]
    tables = []
    for name, matrix in whole.items():
        electrode, other = np.indices(matrix.shape).reshape(2, -1) + 1
        columns = {"set": name, "electrode": electrode, "other": other, "correlation": matrix.ravel()}
        tables.append(pd.DataFrame(columns))
    found = pd.DataFrame(likeness, columns=["first", "second", "correlation"])
    return found, pd.concat(tables, ignore_index=True)


def _alike(first: np.ndarray, second: np.ndarray) -> float:
    """Correlation of the elements above the diagonals."""
    upper = np.triu_indices(len(first), k=1)
    return float(np.corrcoef(first[upper], second[upper])[0, 1])
