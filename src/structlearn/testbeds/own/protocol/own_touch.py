"""A latent space of your own skin (II.3.3), and whether its map is the skin where blocks were held out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from structlearn.ground.errors import InputError
from structlearn.ground.metrics import nmse
from structlearn.ground.parallel import parallel_map
from structlearn.networks.torch_settings import as_tensor
from structlearn.recordings.touch_log import TouchLog
from structlearn.tactile.electrodes import map_laying
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_comparison import asked_of, learn_from
from structlearn.tactile.latent_evaluation import latent_errors
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import SensorDescription
from structlearn.tactile.latent_training import Pairs, draw_pairs
from structlearn.tactile.pressed_skin import PLANE, PressedSkin, held_out, plate_pairs, pressed_skin, walks
from structlearn.tactile.touch_dataset import TEST, TRAIN, Chains, TouchUnits, touch_units
from structlearn.testbeds.own.protocol.own_touch_parameters import TouchParameters

STRUCTURED, PLAIN, COMPONENTS = "structured", "reconstruction only", "3 principal components"
DIMENSIONS = 3
"""Of the latent spaces; as many principal components has the rival."""

WALKS = 200
"""Chains by which units want to know a scale of velocities, though no dynamics are learned."""


@dataclass(frozen=True)
class Touches:
    """Samples in which something touches.

    Attributes:
        sensor: its description.
        counts: (N, E) readings less what reads zero.
        place: (N, 3) m.
        along: distances along the skin; None: straight ones.
    """

    sensor: SensorDescription
    counts: np.ndarray
    place: np.ndarray
    along: Geodesics | None


@dataclass(frozen=True)
class LearnedTouch:
    """What was learned of some touches.

    Attributes:
        models: latent spaces with and without structure.
        units: that they see touch in.
    """

    models: LatentModels
    units: TouchUnits


@dataclass(frozen=True)
class OwnTouchResults:
    """What the folds show.

    Attributes:
        errors: per `fold`, `model` and `seed` on blocks held out: NMSE of `reconstruction` (mean over
            channels), of its `worst_channel`, of map `distances` and of `pressure`; `laid_mm`, median
            distance of where the map lies from where the touch was. NaN where a model has no such thing.
        map: of touches when each was held out: `x_m`, `y_m`, where the map lies `map_x_m`, `map_y_m`, and
            its third number `pressure`; of the first seed.
        recordings: `recording`, `samples`, `touching`.
    """

    errors: pd.DataFrame
    map: pd.DataFrame
    recordings: pd.DataFrame


def learn_own_touch(
    logs: Sequence[TouchLog], parameters: TouchParameters
) -> tuple[LearnedTouch, OwnTouchResults]:
    """Learn from all touches, and fold by fold from those outside of the blocks held out.

    Raises:
        InputError: recordings differ in their channels, nothing touches, places are not known, a channel
            never changes, or touches lie in one block.
        MissingInputError: touches lie in patches too far apart for distances along the skin.
    """
    touches, recordings = gathered(logs, parameters)
    fold = held_out(touches.place[:, :PLANE], 1e-3 * parameters.block_mm, parameters.folds)[1]
    present = np.unique(fold)
    if len(present) < 2:
        raise InputError(
            f"{parameters.source}: touches lie in blocks of one fold; take a smaller block_mm than "
            f"{parameters.block_mm:g}, or record touches elsewhere"
        )
    work = [fold == number for number in present]
    with threadpool_limits(1):  # as in processes of their own, so that their number changes no bit
        judge = partial(_judged, touches=touches, parameters=parameters)
        found = parallel_map(judge, work, "latent spaces of touch", local=True)
        learned = learn_touches(touches, np.full(len(fold), True), parameters)[0]
    errors, maps = zip(*found, strict=True)
    tables = [table.assign(fold=number) for number, table in zip(present, errors, strict=True)]
    return learned, OwnTouchResults(
        pd.concat(tables, ignore_index=True), pd.concat(maps, ignore_index=True), recordings
    )


def gathered(logs: Sequence[TouchLog], parameters: TouchParameters) -> tuple[Touches, pd.DataFrame]:
    """Samples of all recordings in which something touches, and how many each has."""
    channels = logs[0].channels
    sensor = parameters.sensor(channels)
    by_change = sensor.model_copy(update={"by_norm": False})  # whose pressure is in counts
    counts, places, rows = [], [], []
    for log in logs:
        if log.channels != channels:
            raise InputError(
                f"{log.name}: its channels ({', '.join(log.channels)}) are not those of {logs[0].name}"
            )
        air = parameters.air_samples
        zeroed = log.counts[air:] - (log.counts[:air].mean(axis=0) if air else 0.0)
        touching = by_change.seen(zeroed)[1] >= parameters.touched
        rows.append((log.name, len(log.counts), int(touching.sum())))
        counts.append(zeroed[touching])
        places.append(_places(log, sensor, zeroed[touching], touching, parameters))
    every, place = np.concatenate(counts), np.concatenate(places)
    if len(every) < 2:
        raise InputError(f"{parameters.source}: nothing touches: no pressure reaches {parameters.touched:g}")
    kept = np.linspace(0, len(every) - 1, min(len(every), parameters.most_samples)).astype(int)
    every, place = every[kept], place[kept]
    along = geodesics(place, parameters.geodesics) if parameters.places == "channels" else None
    return Touches(sensor, every, place, along), pd.DataFrame(
        rows, columns=["recording", "samples", "touching"]
    )


def _places(
    log: TouchLog,
    sensor: SensorDescription,
    counts: np.ndarray,
    touching: np.ndarray,
    parameters: TouchParameters,
) -> np.ndarray:
    """(N, 3) m of the samples that touch."""
    if parameters.places == "probe":
        if log.place is None:
            raise InputError(f"{log.name}: has no columns x_m and y_m; places: channels needs none")
        return log.place[parameters.air_samples :][touching]
    known = sensor.places_mm
    if known is None or len(known) != len(sensor.channels):
        raise InputError(
            f"{log.name}: channels_mm names {len(known or ())} places of {len(sensor.channels)} channels; "
            "where touches are follows from them"
        )
    change = {"falls": np.minimum(counts, 0.0), "rises": np.maximum(counts, 0.0), "either": counts}
    weight = change[sensor.change] ** 2
    middle = 1e-3 * weight @ np.array(known) / weight.sum(axis=1, keepdims=True)
    return np.hstack([middle, np.zeros((len(middle), 1))])


def learn_touches(
    touches: Touches, taught: np.ndarray, parameters: TouchParameters
) -> tuple[LearnedTouch, PressedSkin]:
    """Learn latent spaces from some touches.

    Args:
        touches: all of them.
        taught: (N,) whether a touch is learned from.
        parameters: see there.

    Returns:
        What was learned, and all touches as they are, those that were not taught in the split `TEST`.
    """
    spaces = parameters.spaces
    rng = np.random.default_rng(spaces.training.seed)
    split = np.where(taught, TRAIN, TEST)
    skin = pressed_skin(touches.sensor, touches.counts, touches.place, split, parameters.copies, rng)
    pairs = _pairs(touches, skin, TRAIN, spaces.pair_pool, rng)
    length = float(np.sqrt(np.mean(pairs.distance**2)))
    walked = walks(skin, WALKS, 1e-3 * parameters.block_mm, rng)
    units = touch_units(skin, walked, length)
    none = Chains(walked.rows[:0], walked.actions[:0], walked.time_step[:0])
    learned = LearnedTouch(learn_from(skin, pairs, none, units, spaces), units)
    return learned, pressed_skin(touches.sensor, touches.counts, touches.place, split)


def _pairs(touches: Touches, skin: PressedSkin, split: int, count: int, rng: np.random.Generator) -> Pairs:
    """Pairs of one split with their distance: straight, or along the skin, in which copies are alike."""
    if touches.along is None:
        return plate_pairs(skin, split, count, rng)
    found = draw_pairs(skin, touches.along, split, count, rng)
    own = len(touches.counts)
    first, second = own * rng.integers(0, len(skin.split) // own, (2, count))
    return Pairs(found.first + first, found.second + second, found.distance)


def _judged(
    left_out: np.ndarray, touches: Touches, parameters: TouchParameters
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors and map of one fold."""
    spaces = parameters.spaces
    learned, skin = learn_touches(touches, ~left_out, parameters)
    rng = np.random.default_rng([spaces.training.seed, TEST])
    pairs = _pairs(touches, skin, TEST, spaces.evaluation_pairs, rng)
    errors = latent_errors(learned.models, {"": asked_of(learned.units, skin, pairs, TEST)})
    errors = errors.rename(columns={"worst_electrode": "worst_channel"}).drop(columns="split")
    errors["model"] = np.where(errors.pop("structure"), STRUCTURED, PLAIN)
    signals = learned.units.signals(skin.signals)
    places, flat, pressure = laid_down(learned, signals, touches.place[:, :PLANE], left_out)
    away = 1e3 * np.linalg.norm(flat - places, axis=-1)
    errors["laid_mm"] = np.nan
    errors.loc[errors["model"] == STRUCTURED, "laid_mm"] = np.median(away, axis=1)
    rival = _components(signals[~left_out], signals[left_out])
    errors = pd.concat([errors, pd.DataFrame([rival])], ignore_index=True)
    columns = ["x_m", "y_m", "map_x_m", "map_y_m", "pressure"]
    table = pd.DataFrame(np.column_stack([places, flat[0], pressure[0]]), columns=columns)
    return errors, table


def laid_down(
    learned: LearnedTouch, signals: np.ndarray, place: np.ndarray, asked: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where maps lie once they are turned and shifted onto the skin by the touches learned from.

    Args:
        learned: M spaces with structure among others.
        signals: (N, E) of all touches in the networks' units.
        place: (N, 2) m of all touches.
        asked: (N,) whether a touch is asked about.

    Returns:
        places: (A, 2) m of those asked about.   flat: (M, A, 2) m of the maps.   pressure: (M, A).
    """
    spaces = learned.models
    seen = as_tensor(signals).T.expand(len(spaces), -1, -1)
    latent = spaces.autoencoders.encoder.forward(seen).transpose(1, 2).double().numpy()
    states = np.array([its for (structure, _), its in zip(spaces.keys(), latent, strict=True) if structure])
    flat = float(learned.units.length) * states[..., :PLANE]
    laid = np.array([map_laying(its[~asked], place[~asked])(its[asked]) for its in flat])
    return place[asked], laid, states[:, asked, PLANE]


def _components(taught: np.ndarray, asked: np.ndarray) -> dict[str, float | str]:
    """Reconstruction by as many principal components as latent spaces have dimensions."""
    middle = taught.mean(axis=0)
    axes = np.linalg.svd(taught - middle, full_matrices=False)[2][:DIMENSIONS]
    errors = nmse((asked - middle) @ axes.T @ axes + middle, asked)
    return {
        "model": COMPONENTS,
        "seed": 0,
        "reconstruction": float(errors.mean()),
        "worst_channel": float(errors.max()),
    }
