"""Estimates of touches by latent spaces and by baselines, and their errors (II.3.3, II.4.3).

The baselines get the same signals: an unstructured autoencoder, principal components, a Gaussian process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from structlearn.networks.torch_settings import as_tensor
from structlearn.tactile.electrodes import align_map
from structlearn.tactile.latent_models import TrainedTouch
from structlearn.tactile.latent_training import Pairs
from structlearn.tactile.pressed_skin import PLANE, PressedSkin
from structlearn.tactile.touch_dataset import TouchUnits
from structlearn.tasks.touch.parameters import DEGREE
from structlearn.tasks.touch.skin_touches import NEVER_VARIES, Touches, learn_skin
from structlearn.tasks.touch.touch_names import COMPONENTS, NEW_BLOCKS, NEW_RUN, PLAIN, PROCESS, STRUCTURED

DIMENSIONS = 3  # of the latent spaces, and number of principal components compared with them
TUNING_SAMPLES = 400  # presses on which the Gaussian process's length scale and noise are chosen

# errors are averaged over the presses of a block
NMSES = ("map_nmse", "pressure_nmse", "signal_nmse", "worst_nmse", "depth_nmse")
BY_BLOCK = dict.fromkeys(NMSES, "mean") | dict.fromkeys(("laid_mm", "latent_mm"), "median")

Estimate = Callable[[np.ndarray], np.ndarray]  # coordinates or signals (N, D) to values (N, K)


@dataclass(frozen=True)
class Reading:
    """Estimates of N presses by one model of `touch_names.SPACES`; NaN for what it does not estimate."""

    model: str
    coordinates: np.ndarray  # (N, D); their distances are compared with those on the skin
    place: np.ndarray  # (N, 2) m, by regression
    depth: np.ndarray | float  # (N,) m, height of the probe, by regression
    seed: int = 0
    aligned: np.ndarray | float = np.nan  # (N, 2) m, the map, rotated and shifted onto the plate
    pressure: np.ndarray | float = np.nan  # (N,), the third latent number
    decoded: np.ndarray | float = np.nan  # (N, E) signals in the networks' units, from the coordinates


def place_errors(
    work: tuple[TrainedTouch | None, Touches, Touches | int],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of models learned from one recording, on another one or on a fold of the same one.

    `work`: the learned models, or None to learn them here without the blocks of the fold; the training
    recording; the test recording, or the number of the fold.

    Returns:
        `block_scores` with the names of both recordings, `learned_from` and `test_run`, and `new`
        (`NEW_BLOCKS` or `NEW_RUN`). Positions of the touches: `x_m`, `y_m`, `z_m`; in the map aligned
        with the plate: `map_x_m`, `map_y_m`; `pressure`, and the names of the recordings.
    """
    learned, run, other = work
    if isinstance(other, Touches):
        new, training, tested = NEW_RUN, np.arange(len(run.counts)), np.arange(len(other.counts))
    else:
        left_out, other, new = run.blocks()[1] == other, run, NEW_BLOCKS
        training, tested = np.flatnonzero(~left_out), np.flatnonzero(left_out)
    learned = learned or learn_skin(run, np.isin(np.arange(len(run.counts)), training), with_dynamics=False)
    estimates = readings(learned, (run, training), other.skin(tested))
    names = {"learned_from": run.name, "test_run": other.name}
    table = block_scores(estimates, learned.units, (other, tested))
    lies = pd.DataFrame(other.place[tested], columns=["x_m", "y_m", "z_m"], dtype=float)
    lies[["map_x_m", "map_y_m"]] = estimates[0].aligned
    return table.assign(**names, new=new), lies.assign(pressure=estimates[0].pressure, **names)


def readings(learned: TrainedTouch, known: tuple[Touches, np.ndarray], tested: PressedSkin) -> list[Reading]:
    """Estimates of touches by all models, from training touches (a recording and its rows).

    Place and depth are polynomials of latent coordinates; place is one of the map alone, if there is a map.
    Baselines have no map: their coordinates are scaled to best fit the distances between training touches.
    """
    run, rows = known
    training, parameters = run.skin(rows), run.parameters
    pairs = run.pairs(rows, parameters.spaces.evaluation_pairs, np.random.default_rng(0))
    spaces, units, wanted = learned.models, learned.units, training.place

    def space(model: str, known: np.ndarray, new: np.ndarray) -> Reading:
        """Reading from latent states (N, 3) of a space without a map."""
        apart = np.linalg.norm(known[pairs.first] - known[pairs.second], axis=1)
        scale = float(apart @ pairs.distance / (apart @ apart))
        read = polynomial(known, wanted, DEGREE)(new)
        return Reading(model, scale * new, read[:, :PLANE], read[:, PLANE])

    def map_of(known: np.ndarray, new: np.ndarray) -> Reading:
        """Reading from latent states (N, 3) whose first two coordinates are a map."""
        length, plane = float(units.length), wanted[:, :PLANE]
        flat = length * new[:, :PLANE]
        return Reading(
            STRUCTURED,
            coordinates=flat,
            place=polynomial(known[:, :PLANE], plane, DEGREE)(new[:, :PLANE]),
            depth=polynomial(known, wanted[:, PLANE:], DEGREE)(new)[:, 0],
            aligned=align_map(length * known[:, :PLANE], plane)(flat),
            pressure=new[:, PLANE],
        )

    seen, new = (units.signals(skin.signals) for skin in (training, tested))
    inputs = (as_tensor(signals).T.expand(len(spaces), -1, -1) for signals in (seen, new))
    states = [
        spaces.autoencoders.encoder.forward(samples).transpose(1, 2).double().numpy() for samples in inputs
    ]
    decoded = spaces.autoencoders.decoder.forward(as_tensor(states[1]).transpose(1, 2)).transpose(1, 2)
    estimates = []
    for (structure, seed), *latent, signals in zip(spaces.keys(), *states, decoded.numpy(), strict=True):
        estimate = map_of(*latent) if structure else space(PLAIN, *latent)
        estimates.append(replace(estimate, seed=seed, decoded=signals))
    middle = seen.mean(axis=0)
    axes = np.linalg.svd(seen - middle, full_matrices=False)[2][:DIMENSIONS]
    components = [(signals - middle) @ axes.T for signals in (seen, new)]
    estimates.append(replace(space(COMPONENTS, *components), decoded=components[1] @ axes + middle))
    read = gaussian_process(seen, wanted, parameters.rival_samples)(new)
    estimates.append(Reading(PROCESS, read[:, :PLANE], read[:, :PLANE], read[:, PLANE]))
    if np.std(wanted[:, PLANE]) < NEVER_VARIES:  # a run of one depth holds no other
        estimates = [replace(estimate, depth=np.nan) for estimate in estimates]
    return estimates


def polynomial(known: np.ndarray, wanted: np.ndarray, degree: int) -> Estimate:
    """Least-squares polynomial of coordinates (N, D) with values (N, K)."""
    from sklearn.linear_model import LinearRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    model = make_pipeline(StandardScaler(), PolynomialFeatures(degree), LinearRegression())
    return model.fit(known, wanted).predict


def gaussian_process(known: np.ndarray, wanted: np.ndarray, count: int) -> Estimate:
    """Gaussian process with one length scale, a baseline that gets all channels and has no map.

    Columns of `wanted` (N, K) that hardly vary are held at their mean. At most `count` evenly spaced samples
    are learned from.
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
    estimates: Sequence[Reading], units: TouchUnits, about: tuple[Touches, np.ndarray]
) -> pd.DataFrame:
    """Errors of readings of N touches (rows of a recording), by blocks of places.

    Errors are divided by the variance over all test touches, so their mean over blocks of similar size is the
    NMSE. NaN for what a model does not estimate, and for depths if all are equal.

    Returns:
        `block`, `presses`, `model`, `seed`; `map_nmse`: of distances to random other touches;
        `pressure_nmse`, `signal_nmse` (decoded), `worst_nmse` (the worst channel) and `depth_nmse`;
        `laid_mm`, `latent_mm`: median distance from the true place of the map, and of the place read.
    """
    run, rows = about
    tested, pairs, block = run.skin(rows), _test_pairs(run, rows), run.blocks()[0][rows]
    place, depth = tested.place[:, :PLANE], tested.place[:, PLANE]
    pressure, signals = units.pressure(tested.pressure), units.signals(tested.signals)
    depths = np.var(depth) if np.std(depth) > NEVER_VARIES else np.nan
    tables = []
    for estimate in estimates:
        apart = np.linalg.norm(estimate.coordinates[pairs.first] - estimate.coordinates[pairs.second], axis=1)
        missed = _by_first((apart - pairs.distance) ** 2, pairs.first, len(block))
        decoded = (estimate.decoded - signals) ** 2 / np.var(signals, axis=0)
        errors = {
            "map_nmse": missed / np.var(pairs.distance),
            "pressure_nmse": (estimate.pressure - pressure) ** 2 / np.var(pressure),
            "signal_nmse": decoded.mean(axis=1),
            "worst_nmse": decoded[:, np.argmax(decoded.mean(axis=0))],
            "depth_nmse": (estimate.depth - depth) ** 2 / depths,
            "laid_mm": 1e3 * np.linalg.norm(estimate.aligned - place, axis=1),
            "latent_mm": 1e3 * np.linalg.norm(estimate.place - place, axis=1),
        }
        by_block = pd.DataFrame(errors).groupby(block).agg(BY_BLOCK).rename_axis("block")
        by_block.insert(0, "presses", np.unique(block, return_counts=True)[1])
        tables.append(by_block.reset_index().assign(model=estimate.model, seed=estimate.seed))
    return pd.concat(tables, ignore_index=True)


def _test_pairs(run: Touches, rows: np.ndarray) -> Pairs:
    """Pairs of test touches; on a plate each touch is the first of equally many pairs."""
    spaces, count = run.parameters.spaces, len(rows)
    rng, each = np.random.default_rng(spaces.training.seed), max(spaces.evaluation_pairs // count, 1)
    if run.along is not None:
        return run.pairs(rows, each * count, rng)
    first, second = np.repeat(np.arange(count), each), rng.integers(0, count, count * each)
    place = run.place[rows, :PLANE]
    return Pairs(first, second, np.linalg.norm(place[first] - place[second], axis=1))


def _by_first(errors: np.ndarray, first: np.ndarray, count: int) -> np.ndarray:
    """Mean error (N,) of the pairs whose first touch is each one; NaN if there is none."""
    order = np.argsort(first, kind="stable")
    each = np.bincount(first, minlength=count)
    if (each == each[0]).all():
        return errors[order].reshape(count, each[0]).mean(axis=1)
    with np.errstate(invalid="ignore"):
        return np.bincount(first, errors, count) / each
