"""A skin that is touched at known places: latent spaces are learned, and judged on touches left out (II.3.3).

Blocks of places are held out, since each place is touched several times: touches left out at random would
have their like among those learned from. With separate recordings, models of one are tested on the others.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.parallel import parallel_map
from structlearn.readers.user_tables import TouchLog
from structlearn.tactile.geodesics import Geodesics, geodesics
from structlearn.tactile.latent_models import LatentModels, write_models
from structlearn.tactile.latent_parameters import SensorDescription
from structlearn.tactile.latent_training import Pairs, draw_pairs, learn_from
from structlearn.tactile.pressed_skin import PLANE, PressedSkin, held_out, plate_pairs, pressed_skin, walks
from structlearn.tactile.touch_dataset import TEST, TRAIN, Chains, TouchUnits, touch_units
from structlearn.tasks.touch.touch_parameters import TouchParameters

TOGETHER = "latent"
"""What all recordings are called where they are learned from together."""

WALKS = 200
"""Chains by which units know a scale of velocities where no dynamics are learned."""

NEVER_VARIES = 1e-4
"""m, standard deviation below which places or depths are taken for one and the same."""


@dataclass(frozen=True)
class Touches:
    """Samples of a recording in which something touches."""

    name: str
    sensor: SensorDescription
    counts: np.ndarray  # (N, E) readings less what reads zero
    place: np.ndarray  # (N, 3) m
    along: Geodesics | None = None  # distances along the skin; None: straight ones

    def skin(self, rows: np.ndarray) -> PressedSkin:
        """Some of them, as they are."""
        return pressed_skin(self.sensor, self.counts[rows], self.place[rows], np.full(len(rows), TEST))

    def pairs(self, rows: np.ndarray, count: int, rng: np.random.Generator) -> Pairs:
        """Random pairs of some of them, by their place in `rows`, with their distance on the skin."""
        if self.along is None:
            return plate_pairs(self.skin(rows), TEST, count, rng)
        split = np.where(np.isin(np.arange(len(self.counts)), rows), TEST, TRAIN)
        whole = pressed_skin(self.sensor, self.counts, self.place, split)
        found = draw_pairs(whole, self.along, TEST, count, rng)
        first, second = (np.searchsorted(rows, its) for its in (found.first, found.second))
        return Pairs(first, second, found.distance)

    def blocks(self, parameters: TouchParameters) -> tuple[np.ndarray, np.ndarray]:
        """(N,) block of places of each, and the fold that holds it out."""
        return held_out(self.place[:, :PLANE], 1e-3 * parameters.block_mm, parameters.folds)


@dataclass(frozen=True)
class LearnedSkin:
    """What was learned of some touches: latent spaces in units, and their dynamics if they were asked for."""

    models: LatentModels
    units: TouchUnits
    sensor: SensorDescription


def learn_touch(
    logs: Sequence[TouchLog], parameters: TouchParameters, folder: Path | None = None
) -> tuple[dict[str, LearnedSkin], dict[str, pd.DataFrame]]:
    """Learn from all touches, and judge on what was left out; write all of it into a folder that is there.

    Recordings with a force that stay at one place teach forces alone.

    Returns:
        Skins by the recording that each was learned from, or `TOGETHER`. Tables by name, those alone that
        have rows: `recordings` (`recording`, `samples`, `touching`), `errors` and `map` of what was held out
        and of other recordings (`skin_readings.block_scores`, `fold_errors`, `other_errors`), `maps`, `servo`
        and `paths` (`skin_servoing`), `force`, `lags` and `traces` (`skin_force`), `published`
        (`skin_readings.within_runs`).

    Raises:
        InputError: recordings differ in their channels, nothing touches, places are not known, or a channel
            never changes.
        MissingInputError: no recording has touches in two blocks of places, or they lie in patches too far
            apart for distances along the skin.
    """
    from structlearn.tasks.touch.skin_force import force_errors
    from structlearn.tasks.touch.skin_readings import fold_errors, other_errors, within_runs
    from structlearn.tasks.touch.skin_servoing import servo_trials

    weighed = [log for log in logs if log.force is not None and np.isfinite(log.force).any()]
    if parameters.force is None:
        weighed = []
    pressed = [log for log in logs if not any(log is one for one in weighed)]
    runs, recordings = gathered(pressed, parameters) if pressed else ([], pd.DataFrame())
    parts: dict[str, list[pd.DataFrame]] = {"recordings": [recordings]}

    def collect(names: Sequence[str], function: Callable[..., Any], work: Sequence[Any], about: str) -> None:
        """Tables of a function that gives one for each name."""
        for found in parallel_map(partial(function, parameters=parameters), work, about, local=True):
            for name, table in zip(names, found, strict=True):
                parts.setdefault(name, []).append(table)

    with threadpool_limits(1):  # as in processes of their own, so that their number changes no bit
        learned = parallel_map(partial(_whole, parameters=parameters), runs, "skins", local=True)
        skins = {run.name: skin for run, skin in zip(runs, learned, strict=True)}
        if runs:
            collect(("errors", "map"), fold_errors, folds_of(runs, parameters), "maps of a skin")
        across = [(skins[run.name], run, [one for one in runs if one is not run]) for run in runs]
        collect(("errors", "maps"), other_errors, across, "other runs")
        if parameters.servo is not None:
            collect(("servo", "paths"), servo_trials, across, "servoing")
        if parameters.published is not None:
            parts["published"] = [within_runs(logs, parameters)]
        if parameters.force is not None:
            one_skin = [log for log in weighed if log.channels == logs[0].channels]
            forces = force_errors(one_skin, parameters.force, parameters.rival_samples)
            parts |= {name: [table] for name, table in zip(("force", "lags", "traces"), forces, strict=True)}
    there = {name: [table for table in its if len(table)] for name, its in parts.items()}
    tables = {name: pd.concat(its, ignore_index=True) for name, its in there.items() if its}
    if folder is not None:
        for name, skin in skins.items():
            path = f"models/{name}.safetensors" if parameters.apart else f"{name}.safetensors"
            write_models(skin.models, skin.units, folder / path)
        for name, table in tables.items():
            write_table(table, folder / f"{name}.parquet")
    return skins, tables


def gathered(logs: Sequence[TouchLog], parameters: TouchParameters) -> tuple[list[Touches], pd.DataFrame]:
    """Samples of each recording, or of all together, in which something touches; and how many each has."""
    channels = logs[0].channels
    sensor = parameters.sensor(channels)
    by_change = sensor.model_copy(update={"by_norm": False})  # whose pressure is in counts
    found, rows = [], []
    for log in logs:
        if log.channels != channels:
            raise InputError(
                f"{log.name}: its channels ({', '.join(log.channels)}) are not those of {logs[0].name}"
            )
        air = parameters.air_samples
        zeroed = log.counts[air:] - log.counts[:air].mean(axis=0) if air else log.counts
        touching = by_change.seen(zeroed)[1] >= parameters.touched
        rows.append((log.name, len(log.counts), int(touching.sum())))
        counts = zeroed if touching.all() else zeroed[touching]
        found.append(Touches(log.name, sensor, counts, _places(log, sensor, counts, touching, parameters)))
    if not parameters.apart:
        every, place = (np.concatenate([getattr(one, name) for one in found]) for name in ("counts", "place"))
        found = [Touches(TOGETHER, sensor, every, place)]
    if sum(len(one.counts) for one in found) < 2:
        raise InputError(f"{parameters.source}: nothing touches: no pressure reaches {parameters.touched:g}")
    return [_thinned(one, parameters) for one in found], pd.DataFrame(
        rows, columns=["recording", "samples", "touching"]
    )


def _thinned(touches: Touches, parameters: TouchParameters) -> Touches:
    """Evenly taken if there are more than are wanted, with distances along the skin where those count."""
    count, counts, place = len(touches.counts), touches.counts, touches.place
    if count > parameters.most_samples:
        kept = np.linspace(0, count - 1, parameters.most_samples).astype(int)
        counts, place = counts[kept], place[kept]
    along = geodesics(place, parameters.geodesics) if parameters.places == "channels" else None
    return Touches(touches.name, touches.sensor, counts, place, along)


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
        place = log.place[parameters.air_samples :]
        return place if touching.all() else place[touching]
    known = sensor.places_mm
    if known is None or len(known) != len(sensor.channels):
        raise InputError(
            f"{log.name}: channels_mm names {len(known or ())} places of {len(sensor.channels)} channels; "
            "where touches are follows from them"
        )
    change = {"falls": np.minimum(counts, 0.0), "rises": np.maximum(counts, 0.0), "either": counts}
    weight = change[sensor.change] ** 2
    middle = 1e-3 * weight @ np.array(known) / weight.sum(axis=1, keepdims=True)
    return np.pad(middle, ((0, 0), (0, 1)))


def folds_of(runs: Sequence[Touches], parameters: TouchParameters) -> list[tuple[Touches, int]]:
    """Recordings and folds that can be held out of them.

    Raises:
        MissingInputError: nothing can be held out of any recording.
    """
    folds = [np.unique(run.blocks(parameters)[1]) for run in runs]
    work = [(run, int(one)) for run, its in zip(runs, folds, strict=True) for one in its if len(its) > 1]
    if not work:
        raise MissingInputError(
            f"{parameters.source}: no touches in two blocks of {parameters.block_mm:g} mm to hold one out; "
            "take a smaller block_mm, or record touches elsewhere"
        )
    return work


def _whole(run: Touches, parameters: TouchParameters) -> LearnedSkin:
    return learn_skin(run, np.full(len(run.counts), True), parameters, parameters.servo is not None)


def learn_skin(
    run: Touches, taught: np.ndarray, parameters: TouchParameters, with_dynamics: bool
) -> LearnedSkin:
    """Learn latent spaces from the touches that are `taught` (N,), and forward and inverse models if wanted.

    Raises:
        InputError: a channel or the pressure never changes.
    """
    spaces, servo = parameters.spaces, parameters.servo
    seed = spaces.training.seed
    rng = np.random.default_rng(seed if servo is None else [seed, servo.seed])
    split = np.where(taught, TRAIN, TEST)
    skin = pressed_skin(run.sensor, run.counts, run.place, split, parameters.copies, rng)
    if run.along is None:
        pairs = plate_pairs(skin, TRAIN, spaces.pair_pool, rng)
    else:  # copies are alike in where they touch
        found = draw_pairs(skin, run.along, TRAIN, spaces.pair_pool, rng)
        copy = len(run.counts) * rng.integers(0, parameters.copies, (2, spaces.pair_pool))
        pairs = Pairs(found.first + copy[0], found.second + copy[1], found.distance)
    length = float(np.sqrt(np.mean(pairs.distance**2)))
    count, reach = (WALKS, parameters.block_mm) if servo is None else (servo.walks, servo.reach_mm)
    chains = walks(skin, count, 1e-3 * reach, rng)
    units = touch_units(skin, chains, length)
    if not with_dynamics:
        chains = Chains(chains.rows[:0], chains.actions[:0], chains.time_step[:0])
    return LearnedSkin(learn_from(skin, pairs, chains, units, spaces), units, run.sensor)
