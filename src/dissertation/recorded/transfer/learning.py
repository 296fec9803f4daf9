"""Latent spaces of recorded touch, and transfer from simulated touch (II.4).

Latent spaces of BioTac touches, slides over materials and logs of unscrewing, are tested on each trial held
out in turn. One of simulated touches of a handle is tested on them too, each set standardised by itself, with
principal components as baseline.

Counts differ in meaning. In the logs of unscrewing they rise under pressure (their mean correlates with the
contact force at 0.98 and more), so their sign is inverted. The slides were published as magnitudes of change,
none below zero: the direction of a change is lost, so each electrode counts as pressed, and magnitudes are
compared with magnitudes.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from dissertation.recorded.transfer.finger_statistics import compared, pca_dimensions
from dissertation.recorded.transfer.parameters import TransferParameters
from dissertation.simulation import fingers, touch_demonstrator
from dissertation.simulation.touch import FingerParameters, TouchFingerParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters, demonstrate, person_with_sensor
from structlearn.core import signals
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import stage_parameters
from structlearn.readers import read_recordings, synchronise
from structlearn.readers.demonstration import Demonstration, Recording, read_streams
from structlearn.tactile.electrodes import SKINS, Skin
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_comparison import SplitData, latent_errors, split_data
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters
from structlearn.tactile.latent_training import learn_spaces, own_units
from structlearn.tactile.touch_dataset import (
    OTHER,
    TEST,
    TRAIN,
    TouchDataParameters,
    TouchDataset,
    TouchUnits,
    contact_points,
    motion_of,
    prepare,
)
from structlearn.tasks.task_files import TaskFiles, write_tables
from structlearn.tasks.touch.touch_names import COMPONENTS, PLAIN, STRUCTURED

SLIDES, UNSCREWING, SCRAPING = "slides", "unscrewing", "scraping"  # sets of the source
SIMULATED, MAGNITUDES = "simulated", "simulated, magnitudes"  # the latter: only the sizes of the changes
PARTNERS = {SLIDES: MAGNITUDES, UNSCREWING: SIMULATED}  # simulated set that is like a recorded one
CLONE = Path("../..")  # from the project of public sets
DIMENSIONS = 3  # of the latent space; the rival has as many principal components
HELD_OUT = 3  # of the simulated trials, which are many and alike, every so many is held out


@dataclass(frozen=True)
class TouchSet:
    """Touches of one origin; the split of the samples is not used."""

    name: str
    samples: TouchDataset
    geodesics: Geodesics

    @property
    def trials(self) -> int:
        """Number of trials."""
        return int(self.samples.trial.max()) + 1

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
    found = {SIMULATED: simulated, MAGNITUDES: magnitudes(simulated, skin)}
    for name, trials in recorded.items():
        sound = [one for one in trials if one.name not in left_out]
        if len(sound) > 1:
            found[name] = held_touch(sound, skin, cutoff_hz)
    sets = {}
    for name, samples in found.items():
        try:
            sets[name] = TouchSet(name, samples, geodesics(samples.contact_point, parameters))
        except MissingInputError as missing:
            print(f"latent touch: {name} left aside: {missing}")
    paired = [sets[name] for both in PARTNERS.items() if set(both) <= set(sets) for name in both]
    if not paired:
        raise MissingInputError("there are no two slides or logs of unscrewing whose touches make a map")
    return paired


def learn(files: TaskFiles, folder: Path) -> None:
    """Write `fingers`, if scraping was recorded, and the tables of `learn_transfer`."""
    recorded = in_sets(read_streams(files.recorded / "streams.parquet"))
    executed = CLONE / "data/raw/scraping/unrolls"
    tables: dict[str, pd.DataFrame] = {}
    if recorded.get(SCRAPING) and any(executed.iterdir()):
        tables["fingers"] = compared(recorded[SCRAPING], read_recordings(executed))
    main = CLONE / "params.yaml"  # of the simulated person and finger
    electrodes = stage_parameters("testbed.touch", fingers.PinchParameters, main)
    touching = stage_parameters("touch_finger", TouchFingerParameters, main).with_electrodes_of(electrodes)
    people = stage_parameters("toucher", ToucherParameters, main)
    tables |= compare_sets(
        recorded,
        files.entry(TransferParameters),
        *person_with_sensor(people, touching),
        stage_parameters("touch_dataset", TouchDataParameters, main),
    )
    write_tables(tables, folder)


def in_sets(recordings: Sequence[Recording]) -> dict[str, list[Recording]]:
    """Group recordings named SET/NAME by set; each is renamed NAME."""
    found: dict[str, list[Recording]] = {}
    for one in recordings:
        name, _, rest = one.name.partition("/")
        found.setdefault(name, []).append(replace(one, name=rest))
    return found


def compare_sets(
    recordings: Mapping[str, Sequence[Recording]],
    parameters: TransferParameters,
    person: ToucherParameters,
    finger: FingerParameters,
    samples: TouchDataParameters,
) -> dict[str, pd.DataFrame]:
    """Compare recorded sets with touches by a simulated person; see `learn_transfer`."""
    skin = SKINS["biotac"]
    recorded = {
        name: [synchronise(one, samples.rate_hz) for one in recordings.get(name, ())] for name in PARTNERS
    }
    if max(map(len, recorded.values())) < 2:
        raise MissingInputError("two slides or two logs of unscrewing are needed")
    fewer = dict.fromkeys(("rotations", "translations"), parameters.simulated_repeats) | {"skin": skin.name}
    person = person.model_copy(update=fewer)
    simulated = [touch_demonstrator.recorded(one, person) for one in demonstrate(person, finger)]
    touches = prepare([synchronise(one, samples.rate_hz) for one in simulated], skin, samples)
    sets = touch_sets(recorded, touches, skin, samples.cutoff_hz, parameters.left_out, parameters.geodesics)
    return learn_transfer(sets, parameters)


def learn_transfer(sets: Sequence[TouchSet], parameters: TransferParameters) -> dict[str, pd.DataFrame]:
    """Learn from every set, and test on trials held out; from simulated sets, on their recorded partner too.

    Returns:
        `errors` per `learned_from` and `test_run` (sets), `part` (its number), `model` and `seed`: mean
        squared errors relative to the variance in the set, of `reconstruction` (mean over electrodes), map
        `distances` and `pressure`; the last two are NaN for components.
        `sets`: `set`, `trials`, and `components` that hold 99 % of the variance.

    Raises InputError: a set has a single trial, or an electrode of it never changes.
    """
    partners = {PARTNERS[one.name]: one for one in sets if one.name in PARTNERS}
    work = [
        (one, partners.get(one.name), part, trials, parameters.spaces)
        for one in sets
        for part, trials in enumerate(held_out(one))
    ]
    rows = [
        (one.name, one.trials, pca_dimensions(its / its.std(axis=0), 0.99))
        for one, its in ((one, one.samples.signals.astype(float)) for one in sets)
    ]
    return {
        "errors": pd.concat(parallel_map(_errors, work, "latent spaces of touch", local=True)),
        "sets": pd.DataFrame(rows, columns=["set", "trials", "components"]),
    }


def held_out(touches: TouchSet) -> list[np.ndarray]:
    """Trials that are held out together: each recorded one in turn, of simulated ones every third once."""
    trials = np.arange(touches.trials)
    if len(trials) < 2:
        raise InputError(f"{touches.name}: of a single trial none can be left out")
    return list(trials[:, None]) if touches.name in PARTNERS else [trials[::HELD_OUT]]


def _errors(
    work: tuple[TouchSet, TouchSet | None, int, np.ndarray, LatentSpaceParameters],
) -> pd.DataFrame:
    """Errors of all models learned from a set without one part of its trials."""
    source, partner, part, trials, parameters = work
    samples, pairs = source.without(trials), parameters.evaluation_pairs
    units = own_units(samples, source.geodesics)
    models = learn_spaces(samples, source.geodesics, units, parameters)
    middle, axes = _components(units.signals(samples.signals[samples.split == TRAIN]))
    tables = []

    def seen(touches: TouchSet, its: TouchDataset, its_units: TouchUnits, split: int) -> SplitData:
        return split_data(its_units, its, touches.geodesics, split, pairs, np.random.default_rng(split))

    # samples to test on, and the set whose variance they are compared with
    tests = {
        source.name: (seen(source, samples, units, TEST), seen(source, source.without(()), units, TRAIN))
    }
    if partner is not None:
        whole = partner.without(())
        data = seen(partner, whole, own_units(whole, partner.geodesics), TRAIN)
        tests[partner.name] = data, data
    for name, (data, whole_set) in tests.items():
        tables.append(latent_errors(models, {name: data}, whole_set).drop(columns="worst_electrode"))
        its = data.signals.numpy() - middle
        squared = ((its @ axes.T @ axes - its) ** 2).mean(axis=0)
        error = float((squared / whole_set.signals.numpy().var(axis=0)).mean())
        rival = {"split": [name], "model": COMPONENTS, "seed": 0, "reconstruction": error}
        tables.append(pd.DataFrame(rival))
    found = pd.concat(tables, ignore_index=True).rename(columns={"split": "test_run"})
    model = found.pop("structure").map({True: STRUCTURED, False: PLAIN})
    return found.assign(model=found["model"].fillna(model), learned_from=source.name, part=part)


def _components(signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (E,) and principal components (`DIMENSIONS`, E) of signals (N, E)."""
    from sklearn.decomposition import PCA

    found = PCA(DIMENSIONS).fit(signals)
    return found.mean_, found.components_
