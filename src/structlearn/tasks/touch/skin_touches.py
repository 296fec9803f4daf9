"""Touches of a skin at known places, and the latent spaces learned from them (II.3.3).

Blocks of places are held out: each place is touched several times, so touches left out at random would have
near-duplicates in the training data.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.touch_log import TouchLog
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_models import TrainedTouch
from structlearn.tactile.latent_training import Pairs, draw_pairs, latent_data, learn_from
from structlearn.tactile.pressed_skin import (
    PLANE,
    PressedSkin,
    drifted,
    held_out,
    plate_pairs,
    skin_signals,
    walks,
)
from structlearn.tactile.touch_dataset import TEST, TRAIN, Chains, touch_units
from structlearn.tasks.touch.parameters import TouchParameters

TOGETHER = "latent"  # name of the models learned from all recordings together
WALKS = 200  # chains that set the unit of velocity where no dynamics are learned
NEVER_VARIES = 1e-4  # m; places or depths with a smaller standard deviation count as one


@dataclass(frozen=True)
class Touches:
    """Samples of a recording in contact."""

    name: str
    counts: np.ndarray  # (N, E), readings minus those at rest
    place: np.ndarray  # (N, 3) m
    parameters: TouchParameters
    along: Geodesics | None = None  # distances along the skin; None: straight ones

    def skin(self, rows: np.ndarray) -> PressedSkin:
        """Skin of the selected touches, without copies."""
        return _skin(self.counts[rows], self.place[rows], np.full(len(rows), TEST), self.parameters)

    def pairs(self, rows: np.ndarray, count: int, rng: np.random.Generator) -> Pairs:
        """Random pairs among some touches, numbered within `rows`, with their distance on the skin."""
        if self.along is None:
            return plate_pairs(self.skin(rows), TEST, count, rng)
        split = np.where(np.isin(np.arange(len(self.counts)), rows), TEST, TRAIN)
        pairs = draw_pairs(split, self.along, TEST, count, rng)
        first, second = (np.searchsorted(rows, numbers) for numbers in (pairs.first, pairs.second))
        return Pairs(first, second, pairs.distance)

    def blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """(N,) block of places of each touch, and (N,) the fold that holds it out."""
        return held_out(self.place[:, :PLANE], 1e-3 * self.parameters.block_mm, self.parameters.folds)


def _skin(
    counts: np.ndarray, place: np.ndarray, split: np.ndarray, parameters: TouchParameters
) -> PressedSkin:
    signals, pressure = skin_signals(counts, parameters.change, parameters.by_norm)
    return PressedSkin(signals, pressure, split, place)


def gathered(logs: Sequence[TouchLog], parameters: TouchParameters) -> tuple[list[Touches], pd.DataFrame]:
    """Touches of each recording, or of all together; and the number of `samples` and `touching` of each."""
    channels = logs[0].channels
    air, touches, rows = parameters.air_samples, [], []
    for log in logs:
        if log.channels != channels:
            raise InputError(
                f"{log.name}: its channels ({', '.join(log.channels)}) are not those of {logs[0].name}"
            )
        zeroed = log.counts[air:] - log.counts[:air].mean(axis=0) if air else log.counts
        touching = skin_signals(zeroed, parameters.change, by_norm=False)[1] >= parameters.touched  # counts
        rows.append((log.name, len(log.counts), int(touching.sum())))
        kept = slice(None) if touching.all() else touching
        counts = zeroed[kept]
        if parameters.places == "channels":
            place = _centroids(log, counts, parameters)
        elif log.place is None:
            raise InputError(f"{log.name}: has no columns x_m and y_m; places: channels needs none")
        else:
            place = log.place[air:][kept]
        touches.append(Touches(log.name, counts, place, parameters))
    if not parameters.apart:
        every, places = (
            np.concatenate([getattr(part, name) for part in touches]) for name in ("counts", "place")
        )
        touches = [Touches(TOGETHER, every, places, parameters)]
    if sum(len(part.counts) for part in touches) < 2:
        raise InputError(f"{parameters.source}: nothing touches: no pressure reaches {parameters.touched:g}")
    table = pd.DataFrame(rows, columns=["recording", "samples", "touching"])
    return [_thinned(part, parameters) for part in touches], table


def _thinned(touches: Touches, parameters: TouchParameters) -> Touches:
    """At most `most_samples` evenly spaced touches, with distances along the skin if places are channels."""
    count, counts, place = len(touches.counts), touches.counts, touches.place
    if count > parameters.most_samples:
        kept = np.linspace(0, count - 1, parameters.most_samples).astype(int)
        counts, place = counts[kept], place[kept]
    along = geodesics(place, parameters.geodesics) if parameters.places == "channels" else None
    return Touches(touches.name, counts, place, parameters, along)


def _centroids(log: TouchLog, counts: np.ndarray, parameters: TouchParameters) -> np.ndarray:
    """Centroids (N, 3) of the channels that change, in m."""
    known = parameters.channels_mm
    if known is None or len(known) != len(log.channels):
        raise InputError(
            f"{log.name}: channels_mm names {len(known or ())} places of {len(log.channels)} channels; "
            "where touches are follows from them"
        )
    change = {"falls": np.minimum(counts, 0.0), "rises": np.maximum(counts, 0.0), "either": counts}
    weight = change[parameters.change] ** 2
    middle = 1e-3 * weight @ np.array(known) / weight.sum(axis=1, keepdims=True)
    return np.pad(middle, ((0, 0), (0, 1)))


def folds_of(runs: Sequence[Touches]) -> list[tuple[None, Touches, int]]:
    """Work for `place_errors`: recordings and their folds; MissingInputError if nothing can be held out."""
    folds = [(run, np.unique(run.blocks()[1])) for run in runs]
    work = [(None, run, int(fold)) for run, numbers in folds for fold in numbers if len(numbers) > 1]
    if not work:
        parameters = runs[0].parameters
        raise MissingInputError(
            f"{parameters.source}: no touches in two blocks of {parameters.block_mm:g} mm to hold one out; "
            "take a smaller block_mm, or record touches elsewhere"
        )
    return work


def learn_skin(run: Touches, training: np.ndarray, with_dynamics: bool) -> TrainedTouch:
    """Train latent spaces, with `with_dynamics` also forward and inverse models, on touches of a mask (N,).

    Raises InputError if a channel or the pressure never changes.
    """
    parameters = run.parameters
    spaces, servo, seed = parameters.spaces, parameters.servo, parameters.spaces.training.seed
    rng = np.random.default_rng(seed if servo is None else [seed, servo.seed])
    split = np.where(training, TRAIN, TEST)
    counts, copies = run.counts, parameters.copies
    if copies > 1:
        counts = drifted(counts, parameters.gain_spread, copies, rng)
    skin = _skin(counts, np.tile(run.place, (copies, 1)), np.tile(split, copies), parameters)
    if run.along is None:
        pairs = plate_pairs(skin, TRAIN, spaces.pair_pool, rng)
    else:  # copies touch at the same places
        drawn = draw_pairs(skin.split, run.along, TRAIN, spaces.pair_pool, rng)
        copy = len(run.counts) * rng.integers(0, copies, (2, spaces.pair_pool))
        pairs = Pairs(drawn.first + copy[0], drawn.second + copy[1], drawn.distance)
    length = float(np.sqrt(np.mean(pairs.distance**2)))
    count, reach = (WALKS, parameters.block_mm) if servo is None else (servo.walks, servo.reach_mm)
    chains = walks(skin, count, 1e-3 * reach, rng)
    units = touch_units(skin, chains, length)
    if not with_dynamics:
        chains = Chains(chains.rows[:0], chains.actions[:0], chains.time_step[:0])
    return TrainedTouch(learn_from(latent_data(skin, pairs, chains, units), spaces), units)
