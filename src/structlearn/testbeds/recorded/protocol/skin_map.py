"""Is the latent map the skin? Maps learned from presses, judged by where the presses were (II.3.3, II.4.3).

Blocks of places are held out, since each place was pressed several times: presses left out at random would
have their like among those learned from. Then what was learned from one run is asked about another one,
hours apart. Rivals see the same signals: an autoencoder without structure, principal components, a Gaussian
process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from structlearn.ground.errors import MissingInputError
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import as_tensor
from structlearn.recordings.eflesh import ProbeRun
from structlearn.tactile.electrodes import map_laying
from structlearn.tactile.latent_comparison import learn_from
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import SensorDescription
from structlearn.tactile.pressed_skin import (
    PLANE,
    PressedSkin,
    held_out,
    plate_pairs,
    pressed_skin,
    walks,
)
from structlearn.tactile.touch_dataset import TEST, TRAIN, Chains, TouchUnits, touch_units
from structlearn.testbeds.recorded.protocol.latent_touch_parameters import SkinParameters

STRUCTURED, PLAIN, COMPONENTS, PROCESS = (
    "structured",
    "reconstruction only",
    "3 principal components",
    "Gaussian process",
)
MODELS = (STRUCTURED, PLAIN, COMPONENTS, PROCESS)

NEW_BLOCKS, NEW_RUN = "new blocks", "new run"
"""What is new in the presses that are asked about."""

DIMENSIONS = 3
"""Of the latent spaces; as many principal components has the rival."""

TUNING_SAMPLES = 400
"""Presses on which the Gaussian process chooses its length scale and noise."""

BY_BLOCK = dict.fromkeys(("map_nmse", "pressure_nmse", "signal_nmse", "depth_nmse"), "mean") | dict.fromkeys(
    ("laid_mm", "latent_mm"), "median"
)
"""How errors of presses become one of their block."""

NEVER_VARIES = 1e-4
"""m, standard deviation below which the depth of a run is taken for one and the same."""


@dataclass(frozen=True)
class LearnedSkin:
    """What was learned from the training presses of a run.

    Attributes:
        models: latent spaces, and their dynamics if they were asked for.
        units: that they see touch in.
        sensor: description of what was pressed.
    """

    models: LatentModels
    units: TouchUnits
    sensor: SensorDescription


@dataclass(frozen=True)
class Reading:
    """What one model makes of N presses; None where it has no such thing.

    Attributes:
        model: one of `MODELS`.
        seed: its number.
        coordinates: (N, D) of which distances are those on the skin.
        place: (N, 2) m, read by regression.
        depth: (N,) m, height of the probe, read by regression.
        laid: (N, 2) m where the map lies once it is turned and shifted onto the plate.
        pressure: (N,) the third latent number.
        decoded: (N, E) signals in the networks' units, from the coordinates.
    """

    model: str
    seed: int
    coordinates: np.ndarray
    place: np.ndarray
    depth: np.ndarray | None
    laid: np.ndarray | None = None
    pressure: np.ndarray | None = None
    decoded: np.ndarray | None = None


def map_errors(runs: Sequence[ProbeRun], parameters: SkinParameters) -> pd.DataFrame:
    """Errors of all models on blocks held out, block by block.

    Args:
        runs: over places; of one whose blocks fall into one fold nothing can be held out.
        parameters: see there.

    Returns:
        See `block_scores`; `learned_from` and `asked_about` are the same run, `new` is `NEW_BLOCKS`.

    Raises:
        InputError: a channel or the pressure never changes.
        MissingInputError: nothing can be held out of any run.
    """
    side = 1e-3 * parameters.block_mm
    folds = {run.name: np.unique(held_out(run.place[:, :PLANE], side, parameters.folds)[1]) for run in runs}
    work = [(run, fold) for run in runs for fold in folds[run.name] if len(folds[run.name]) > 1]
    if not work:
        raise MissingInputError(f"no presses in two blocks of {parameters.block_mm:g} mm to hold one out")
    return pd.concat(
        parallel_map(partial(_fold_errors, parameters=parameters), work, "maps of a skin", local=True),
        ignore_index=True,
    )


def _fold_errors(work: tuple[ProbeRun, int], parameters: SkinParameters) -> pd.DataFrame:
    run, fold = work
    block, folds = held_out(run.place[:, :PLANE], 1e-3 * parameters.block_mm, parameters.folds)
    left_out = folds == fold
    learned = learn_skin(run, ~left_out, parameters, with_dynamics=False)
    taught, asked = (
        pressed_skin(learned.sensor, run.counts[rows], run.place[rows], np.full(rows.sum(), TEST))
        for rows in (~left_out, left_out)
    )
    table = block_scores(
        readings(learned, taught, asked, parameters), learned.units, asked, block[left_out], parameters
    )
    return table.assign(learned_from=run.name, asked_about=run.name, new=NEW_BLOCKS)


def learn_runs(runs: Sequence[ProbeRun], parameters: SkinParameters) -> list[LearnedSkin]:
    """Latent spaces and their dynamics, learned from the whole of each run."""
    return parallel_map(partial(_whole, parameters=parameters), runs, "skins", local=True)


def _whole(run: ProbeRun, parameters: SkinParameters) -> LearnedSkin:
    return learn_skin(run, np.full(len(run.counts), True), parameters, with_dynamics=True)


def other_run_errors(
    learned: LearnedSkin, run: ProbeRun, others: Sequence[ProbeRun], parameters: SkinParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of all models on other runs, and where their presses lie in the map.

    Args:
        learned: from the whole of `run`.
        run: that was learned from.
        others: that are asked about.
        parameters: see there.

    Returns:
        Errors with the columns of `map_errors`, where `new` is `NEW_RUN`. The map of the first seed with
        structure, laid onto the plate: `learned_from`, `asked_about`, `x_m`, `y_m`, `z_m` of the presses,
        `map_x_m`, `map_y_m`, `pressure` (third latent number).
    """
    taught = _all_presses(learned, run)
    tables, maps = [], []
    for other in others:
        asked = _all_presses(learned, other)
        block, _ = held_out(other.place[:, :PLANE], 1e-3 * parameters.block_mm, parameters.folds)
        found = readings(learned, taught, asked, parameters)
        table = block_scores(found, learned.units, asked, block, parameters)
        names = {"learned_from": run.name, "asked_about": other.name}
        tables.append(table.assign(**names, new=NEW_RUN))
        lies = pd.DataFrame(asked.place, columns=["x_m", "y_m", "z_m"], dtype=float)
        lies[["map_x_m", "map_y_m"]] = found[0].laid
        maps.append(lies.assign(pressure=found[0].pressure, **names))
    return tuple(pd.concat(one, ignore_index=True) if one else pd.DataFrame() for one in (tables, maps))


def _all_presses(learned: LearnedSkin, run: ProbeRun) -> PressedSkin:
    return pressed_skin(learned.sensor, run.counts, run.place, np.full(len(run.counts), TEST))


def learn_skin(
    run: ProbeRun, taught: np.ndarray, parameters: SkinParameters, with_dynamics: bool
) -> LearnedSkin:
    """Learn latent spaces from presses of a run.

    Args:
        run: over places.
        taught: (N,) whether a press is learned from.
        parameters: see there.
        with_dynamics: whether forward and inverse models are learned too.

    Raises:
        InputError: a channel or the pressure never changes.
    """
    sensor, spaces = parameters.description(), parameters.spaces
    rng = np.random.default_rng([spaces.training.seed, parameters.servo.seed])
    split = np.where(taught, TRAIN, TEST)
    skin = pressed_skin(sensor, run.counts, run.place, split, parameters.copies, rng)
    pairs = plate_pairs(skin, TRAIN, spaces.pair_pool, rng)
    chains = walks(skin, parameters.servo.walks, 1e-3 * parameters.servo.reach_mm, rng)
    length = float(np.sqrt(np.mean(pairs.distance**2)))
    units = touch_units(skin, chains, length)
    if not with_dynamics:
        chains = Chains(chains.rows[:0], chains.actions[:0], chains.time_step[:0])
    return LearnedSkin(learn_from(skin, pairs, chains, units, spaces), units, sensor)


def latent_states(learned: LearnedSkin, skin: PressedSkin) -> np.ndarray:
    """(M, N, 3) of presses, in the order of `LatentModels.keys`."""
    signals = as_tensor(learned.units.signals(skin.signals)).T.expand(len(learned.models), -1, -1)
    return learned.models.autoencoders.encoder.forward(signals).transpose(1, 2).double().numpy()


def readings(
    learned: LearnedSkin, taught: PressedSkin, asked: PressedSkin, parameters: SkinParameters
) -> list[Reading]:
    """What all models make of presses, by what they know of the taught ones.

    Place and depth are read off latent coordinates by polynomials, place off the map alone where there is
    one. Rivals have no map: their coordinates are scaled so that distances between taught presses fit best.

    Args:
        learned: the latent spaces.
        taught: presses that were learned from, as they are.
        asked: presses to be read.
        parameters: see there.
    """
    spaces, found = learned.models, []
    states = [latent_states(learned, skin) for skin in (taught, asked)]
    decoded = (
        spaces.autoencoders.decoder.forward(as_tensor(states[1]).transpose(1, 2)).transpose(1, 2).numpy()
    )
    for (structure, seed), known, new, signals in zip(spaces.keys(), *states, decoded, strict=True):
        if structure:
            one = _map_reading(known, new, float(learned.units.length), taught.place, parameters.degree)
        else:
            one = _space_reading(PLAIN, known, new, taught, parameters)
        found.append(replace(one, seed=seed, decoded=signals))
    known, new = (learned.units.signals(skin.signals) for skin in (taught, asked))
    middle = known.mean(axis=0)
    axes = np.linalg.svd(known - middle, full_matrices=False)[2][:DIMENSIONS]
    taught_components, components = ((signals - middle) @ axes.T for signals in (known, new))
    one = _space_reading(COMPONENTS, taught_components, components, taught, parameters)
    found.append(replace(one, decoded=components @ axes + middle))
    read = gaussian_process(known, taught.place, parameters.rival_samples)(new)
    found.append(Reading(PROCESS, 0, read[:, :PLANE], read[:, :PLANE], read[:, PLANE]))
    if np.std(taught.place[:, PLANE]) < NEVER_VARIES:  # a run of one depth teaches nothing of others
        found = [replace(one, depth=None) for one in found]
    return found


def _map_reading(
    known: np.ndarray, new: np.ndarray, length: float, wanted: np.ndarray, degree: int
) -> Reading:
    """By the latent states (N, 3) of a map, and places (N, 3) of those known."""
    flat, plane = length * new[:, :PLANE], wanted[:, :PLANE]
    return Reading(
        model=STRUCTURED,
        seed=0,
        coordinates=flat,
        place=polynomial(known[:, :PLANE], plane, degree)(new[:, :PLANE]),
        depth=polynomial(known, wanted[:, PLANE:], degree)(new)[:, 0],
        laid=map_laying(length * known[:, :PLANE], plane)(flat),
        pressure=new[:, PLANE],
    )


def _space_reading(
    model: str, known: np.ndarray, new: np.ndarray, taught: PressedSkin, parameters: SkinParameters
) -> Reading:
    """By the latent states (N, 3) of a space that has no map."""
    pairs = plate_pairs(taught, TEST, parameters.spaces.evaluation_pairs, np.random.default_rng(0))
    apart = np.linalg.norm(known[pairs.first] - known[pairs.second], axis=1)
    scale = float(apart @ pairs.distance / (apart @ apart))
    read = polynomial(known, taught.place, parameters.degree)(new)
    return Reading(model, 0, scale * new, read[:, :PLANE], read[:, PLANE])


def polynomial(known: np.ndarray, wanted: np.ndarray, degree: int) -> Callable[[np.ndarray], np.ndarray]:
    """Least-squares polynomial of all coordinates.

    Args:
        known: (N, D) coordinates.
        wanted: (N, K) at them.
        degree: of its monomials, at most.

    Returns:
        Function of coordinates (M, D) with values (M, K).
    """
    from sklearn.linear_model import LinearRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    return (
        make_pipeline(StandardScaler(), PolynomialFeatures(degree), LinearRegression())
        .fit(known, wanted)
        .predict
    )


def gaussian_process(known: np.ndarray, wanted: np.ndarray, count: int) -> Callable[[np.ndarray], np.ndarray]:
    """A Gaussian process with one length scale, the rival that sees all channels and has no map.

    Args:
        known: (N, E) signals.
        wanted: (N, K) at them; a column that hardly varies is held at its mean.
        count: presses that it knows at most, evenly taken.

    Returns:
        Function of signals (M, E) with values (M, K).
    """
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    mean, spread = wanted.mean(axis=0), wanted.std(axis=0)
    varies = spread > NEVER_VARIES
    targets = ((wanted - mean) / np.where(varies, spread, 1.0))[:, varies]
    kernel = ConstantKernel(2.0) * RBF(np.sqrt(known.shape[1])) + WhiteKernel(0.01)
    few, more = (
        np.linspace(0, len(known) - 1, min(n, len(known))).astype(int) for n in (TUNING_SAMPLES, count)
    )
    tuned = GaussianProcessRegressor(kernel).fit(known[few], targets[few]).kernel_
    process = GaussianProcessRegressor(tuned, optimizer=None).fit(known[more], targets[more])

    def read(signals: np.ndarray) -> np.ndarray:
        values = np.tile(mean, (len(signals), 1))
        values[:, varies] += spread[varies] * process.predict(signals).reshape(len(signals), -1)
        return values

    return read


def block_scores(
    found: Sequence[Reading],
    units: TouchUnits,
    asked: PressedSkin,
    block: np.ndarray,
    parameters: SkinParameters,
) -> pd.DataFrame:
    """Errors of readings, block by block.

    Errors are normalised by the variance over all presses asked about, so that their mean over blocks of
    like size is the NMSE.

    Args:
        found: of `readings`.
        units: of the latent spaces.
        asked: presses.
        block: (N,) number of each press's block.
        parameters: see there.

    Returns:
        `block`, `presses`, `model`, `seed`; `map_nmse`: of distances to random presses asked about;
        `pressure_nmse`, `signal_nmse` (of what is decoded) and `depth_nmse`; `laid_mm`, `latent_mm`: median
        distance of where the map lies, or of the place that is read, from where the press was. NaN where a
        model has no such number, or all presses are equally deep.
    """
    rng = np.random.default_rng(parameters.spaces.training.seed)
    count, each = len(block), max(parameters.spaces.evaluation_pairs // len(block), 1)
    first, second = np.repeat(np.arange(count), each), rng.integers(0, count, count * each)
    place, depth = asked.place[:, :PLANE], asked.place[:, PLANE]
    distance = np.linalg.norm(place[first] - place[second], axis=1)
    pressure, signals = units.pressure(asked.pressure), units.signals(asked.signals)
    differing = depth if np.std(depth) > NEVER_VARIES else None
    tables = []
    for one in found:
        apart = np.linalg.norm(one.coordinates[first] - one.coordinates[second], axis=1)
        missed = ((apart - distance) ** 2).reshape(count, each).mean(axis=1)
        table = pd.DataFrame(
            {
                "map_nmse": missed / np.var(distance),
                "pressure_nmse": _normalised(one.pressure, pressure),
                "signal_nmse": _normalised(one.decoded, signals),
                "depth_nmse": _normalised(one.depth, differing),
                "laid_mm": _away_mm(one.laid, place),
                "latent_mm": _away_mm(one.place, place),
            }
        )
        by_block = table.groupby(block).agg(BY_BLOCK).rename_axis("block")
        by_block.insert(0, "presses", np.unique(block, return_counts=True)[1])
        tables.append(by_block.reset_index().assign(model=one.model, seed=one.seed))
    return pd.concat(tables, ignore_index=True)


def _normalised(read: np.ndarray | None, true: np.ndarray | None) -> np.ndarray | float:
    """Squared error of each press over the variance of all, (N,), meant over columns; NaN without either."""
    if read is None or true is None:
        return np.nan
    error = (read - true) ** 2 / np.var(true, axis=0)
    return error if error.ndim == 1 else error.mean(axis=1)


def _away_mm(read: np.ndarray | None, true: np.ndarray) -> np.ndarray | float:
    return np.nan if read is None else 1e3 * np.linalg.norm(read - true, axis=1)
