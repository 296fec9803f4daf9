"""What models make of touches, and how far off it is: whether the latent map is the skin (II.3.3, II.4.3).

Rivals see the same signals: an autoencoder without structure, principal components, a Gaussian process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from structlearn.networks.torch_settings import as_tensor
from structlearn.tactile.electrodes import map_laying
from structlearn.tactile.latent_training import Pairs
from structlearn.tactile.pressed_skin import PLANE, PressedSkin
from structlearn.tasks.touch.skin_touches import NEVER_VARIES, LearnedSkin, Touches, learn_skin
from structlearn.tasks.touch.touch_names import COMPONENTS, NEW_BLOCKS, NEW_RUN, PLAIN, PROCESS, STRUCTURED
from structlearn.tasks.touch.touch_parameters import TouchParameters

DIMENSIONS = 3
"""Of the latent spaces; as many principal components has the rival."""

TUNING_SAMPLES = 400
"""Presses on which the Gaussian process chooses its length scale and noise."""

NMSES = ("map_nmse", "pressure_nmse", "signal_nmse", "worst_nmse", "depth_nmse")
BY_BLOCK = dict.fromkeys(NMSES, "mean") | dict.fromkeys(("laid_mm", "latent_mm"), "median")
"""How errors of presses become one of their block."""


@dataclass(frozen=True)
class Reading:
    """What one model makes of N presses; None where it has no such thing.

    Attributes:
        model: one of `touch_names.SPACES`.
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


def fold_errors(work: tuple[Touches, int], parameters: TouchParameters) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors on the blocks of one fold, held out of what is learned from.

    Returns:
        `block_scores` with `learned_from` and `asked_about`, the same recording, and `new` (`NEW_BLOCKS`).
        Where these touches lie in the map: see `_lies`.
    """
    run, fold = work
    block, folds = run.blocks(parameters)
    left_out = folds == fold
    learned = learn_skin(run, ~left_out, parameters, with_dynamics=False)
    taught, asked = np.flatnonzero(~left_out), np.flatnonzero(left_out)
    found = readings(learned, (run, taught), run.skin(asked), parameters)
    names = {"learned_from": run.name, "asked_about": run.name}
    table = block_scores(found, learned, (run, asked), block[asked], parameters)
    return table.assign(**names, new=NEW_BLOCKS), _lies(found[0], run.place[asked], names)


def other_errors(
    work: tuple[LearnedSkin, Touches, Sequence[Touches]], parameters: TouchParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of what was learned from one recording on others, and where their touches lie in the map.

    Returns:
        The columns of `fold_errors`, where `new` is `NEW_RUN`.
    """
    learned, run, others = work
    tables, maps = [], []
    for other in others:
        asked = np.arange(len(other.counts))
        found = readings(learned, (run, np.arange(len(run.counts))), other.skin(asked), parameters)
        names = {"learned_from": run.name, "asked_about": other.name}
        table = block_scores(found, learned, (other, asked), other.blocks(parameters)[0], parameters)
        tables.append(table.assign(**names, new=NEW_RUN))
        maps.append(_lies(found[0], other.place, names))
    return joined(tables), joined(maps)


def joined(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Of no tables an empty one."""
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _lies(reading: "Reading", place: np.ndarray, names: dict[str, str]) -> pd.DataFrame:
    """`x_m`, `y_m`, `z_m` of touches, `map_x_m`, `map_y_m` of the map laid onto the plate, `pressure`."""
    lies = pd.DataFrame(place, columns=["x_m", "y_m", "z_m"], dtype=float)
    lies[["map_x_m", "map_y_m"]] = reading.laid
    return lies.assign(pressure=reading.pressure, **names)


def latent_states(learned: LearnedSkin, skin: PressedSkin) -> np.ndarray:
    """(M, N, 3) of presses, in the order of `LatentModels.keys`."""
    signals = as_tensor(learned.units.signals(skin.signals)).T.expand(len(learned.models), -1, -1)
    return learned.models.autoencoders.encoder.forward(signals).transpose(1, 2).double().numpy()


def readings(
    learned: LearnedSkin,
    known: tuple[Touches, np.ndarray],
    asked: PressedSkin,
    parameters: TouchParameters,
) -> list[Reading]:
    """What all models make of touches, by what they know of those learned from (a recording and its rows).

    Place and depth are read off latent coordinates by polynomials, place off the map alone where there is
    one. Rivals have no map: their coordinates are scaled so that distances between taught touches fit best.
    """
    run, rows = known
    taught = run.skin(rows)
    pairs = run.pairs(rows, parameters.spaces.evaluation_pairs, np.random.default_rng(0))

    def space(model: str, known: np.ndarray, new: np.ndarray) -> Reading:
        """By the latent states (N, 3) of a space that has no map."""
        apart = np.linalg.norm(known[pairs.first] - known[pairs.second], axis=1)
        scale = float(apart @ pairs.distance / (apart @ apart))
        read = polynomial(known, taught.place, parameters.degree)(new)
        return Reading(model, 0, scale * new, read[:, :PLANE], read[:, PLANE])

    spaces, found = learned.models, []
    states = [latent_states(learned, skin) for skin in (taught, asked)]
    decoded = (
        spaces.autoencoders.decoder.forward(as_tensor(states[1]).transpose(1, 2)).transpose(1, 2).numpy()
    )
    for (structure, seed), states_known, new, signals in zip(spaces.keys(), *states, decoded, strict=True):
        if structure:
            one = _map_reading(
                states_known, new, float(learned.units.length), taught.place, parameters.degree
            )
        else:
            one = space(PLAIN, states_known, new)
        found.append(replace(one, seed=seed, decoded=signals))
    seen, new = (learned.units.signals(skin.signals) for skin in (taught, asked))
    middle = seen.mean(axis=0)
    axes = np.linalg.svd(seen - middle, full_matrices=False)[2][:DIMENSIONS]
    taught_components, components = ((signals - middle) @ axes.T for signals in (seen, new))
    one = space(COMPONENTS, taught_components, components)
    found.append(replace(one, decoded=components @ axes + middle))
    read = gaussian_process(seen, taught.place, parameters.rival_samples)(new)
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


def polynomial(known: np.ndarray, wanted: np.ndarray, degree: int) -> Callable[[np.ndarray], np.ndarray]:
    """Least-squares polynomial of coordinates (N, D): function of others (M, D) with values (M, K)."""
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

    Columns of `wanted` (N, K) that hardly vary are held at their mean; at most `count` of the samples are
    known, evenly taken. The function takes signals (M, E) and gives values (M, K).
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
    learned: LearnedSkin,
    about: tuple[Touches, np.ndarray],
    block: np.ndarray,
    parameters: TouchParameters,
) -> pd.DataFrame:
    """Errors of readings of N touches, rows of a recording, by the (N,) blocks that they belong to.

    Errors are normalised by the variance over all touches asked about, so that their mean over blocks of
    like size is the NMSE.

    Returns:
        `block`, `presses`, `model`, `seed`; `map_nmse`: of distances to random touches asked about;
        `pressure_nmse`, `signal_nmse` (of what is decoded), `worst_nmse` (of the worst channel) and
        `depth_nmse`; `laid_mm`, `latent_mm`: median distance of where the map lies, or of the place that is
        read, from where the touch was. NaN where a model has no such number, or all touches are equally deep.
    """
    asked, units = about[0].skin(about[1]), learned.units
    pairs = _asked_pairs(*about, parameters)
    place, depth = asked.place[:, :PLANE], asked.place[:, PLANE]
    pressure, signals = units.pressure(asked.pressure), units.signals(asked.signals)
    differing = depth if np.std(depth) > NEVER_VARIES else None
    tables = []
    for one in found:
        apart = np.linalg.norm(one.coordinates[pairs.first] - one.coordinates[pairs.second], axis=1)
        missed = _by_first((apart - pairs.distance) ** 2, pairs.first, len(block))
        decoded = None if one.decoded is None else (one.decoded - signals) ** 2 / np.var(signals, axis=0)
        table = pd.DataFrame(
            {
                "map_nmse": missed / np.var(pairs.distance),
                "pressure_nmse": _normalised(one.pressure, pressure),
                "signal_nmse": np.nan if decoded is None else decoded.mean(axis=1),
                "worst_nmse": np.nan if decoded is None else decoded[:, np.argmax(decoded.mean(axis=0))],
                "depth_nmse": _normalised(one.depth, differing),
                "laid_mm": _away_mm(one.laid, place),
                "latent_mm": _away_mm(one.place, place),
            }
        )
        by_block = table.groupby(block).agg(BY_BLOCK).rename_axis("block")
        by_block.insert(0, "presses", np.unique(block, return_counts=True)[1])
        tables.append(by_block.reset_index().assign(model=one.model, seed=one.seed))
    return pd.concat(tables, ignore_index=True)


def _asked_pairs(run: Touches, rows: np.ndarray, parameters: TouchParameters) -> Pairs:
    """Pairs of touches asked about; on a plate each touch is the first of equally many."""
    rng, count = np.random.default_rng(parameters.spaces.training.seed), len(rows)
    each = max(parameters.spaces.evaluation_pairs // count, 1)
    if run.along is not None:
        return run.pairs(rows, each * count, rng)
    first, second = np.repeat(np.arange(count), each), rng.integers(0, count, count * each)
    place = run.place[rows, :PLANE]
    return Pairs(first, second, np.linalg.norm(place[first] - place[second], axis=1))


def _by_first(errors: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """(N,) mean error of the pairs whose first is each touch; NaN where there is none."""
    order = np.argsort(first, kind="stable")
    each = np.bincount(first, minlength=count)
    if (each == each[0]).all():
        return errors[order].reshape(count, each[0]).mean(axis=1)
    with np.errstate(invalid="ignore"):
        return np.bincount(first, errors, count) / each


def _normalised(read: np.ndarray | None, true: np.ndarray | None) -> np.ndarray | float:
    """Squared error of each touch over the variance of all, (N,); NaN without either."""
    return np.nan if read is None or true is None else (read - true) ** 2 / np.var(true)


def _away_mm(read: np.ndarray | None, true: np.ndarray) -> np.ndarray | float:
    return np.nan if read is None else 1e3 * np.linalg.norm(read - true, axis=1)
