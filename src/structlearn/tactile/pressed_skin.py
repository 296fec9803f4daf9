"""Skins pressed at known places: samples for latent spaces, actions between presses, servoing on recordings.

A BioTac's electrode counts fall under pressure, and their mean measures it. Other skins have signed channels
with wide coupling: a magnetometer's axis may rise or fall, so the norm of all channels measures the pressure
and their direction the place. A common gain, which drifts, changes only the norm.

Nothing slides here. A press is one sample, and moving to a nearby press is an action: the displacement of the
probe in one step. On a flat skin geodesics are straight, so distances are those on the plate. A controller
learned from one run can be tested on another run without a robot: a dense recording holds readings nearly
everywhere, and the nearest press answers.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from structlearn.core.errors import InputError
from structlearn.tactile.latent_training import CHAIN_STEPS, Pairs
from structlearn.tactile.servo_controller import TactileServo
from structlearn.tactile.touch_dataset import TRAIN, Chains, TouchSamples

STEP_S = 1.0  # duration of an action: velocity in m/s equals displacement in m per step
PLANE = 2  # coordinates on the plate; the third is the height of the probe
STILL = 0.01  # share of the action's largest component (RMS) below which a component counts as zero
ROUNDING = 1e-3  # of a block's side: commanded places are exact only to tenths of a micrometre

Change = Literal["falls", "rises", "either"]  # of readings under pressure


@dataclass(frozen=True)
class PressedSkin(TouchSamples):
    """N presses at known places."""

    place: np.ndarray  # (N, 3) m of the probe


def skin_signals(counts: np.ndarray, change: Change, by_norm: bool) -> tuple[np.ndarray, np.ndarray]:
    """Signals for a latent space, and the contact pressure, from readings (N, E) minus those at rest.

    `by_norm`: readings are divided by their norm, whose logarithm becomes an additional channel. Returns
    signals (N, E), or (N, E + 1) by norm; and pressure (N,): p = -mean(s) for falling readings (eq. II.1),
    mean(s) for rising ones, else the norm, or its logarithm by norm. Raises InputError: a row to be divided
    by its norm is zero.
    """
    strength = np.linalg.norm(counts, axis=1)
    pressure = {"falls": -counts.mean(axis=1), "rises": counts.mean(axis=1), "either": strength}[change]
    if not by_norm:
        return counts, pressure
    if not strength.all():
        raise InputError(f"sensor: row {int(np.argmin(strength))} is zero in all channels: nothing touches")
    strength = strength[:, None]
    signals = np.hstack([counts / strength, np.log(strength)])
    return signals, signals[:, -1] if change == "either" else pressure


def drifted(counts: np.ndarray, spread: float, copies: int, rng: np.random.Generator) -> np.ndarray:
    """Readings (copies N, E): the original, then copies, each row with a gain of log-normal `spread`."""
    gains = np.exp(spread * rng.standard_normal(((copies - 1) * len(counts), 1)))
    return np.vstack([counts, np.tile(counts, (copies - 1, 1)) * gains])


def held_out(place: np.ndarray, side: float, folds: int) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of a plate, and the folds that hold them out: never two neighbours at once, nor all corners.

    Remainders at the far edges belong to the last blocks. `place` (N, 2) m; `side`: m of a block; `folds`:
    F >= 4 keeps neighbours apart. Returns `block` (N,) numbers; `fold` (N,) 0 to F - 1.
    """
    start, extent = place.min(axis=0), np.ptp(place, axis=0)
    count = np.maximum(np.floor(extent / side + ROUNDING), 1)
    column, row = np.minimum(np.floor((place - start) / side + ROUNDING), count - 1).astype(int).T
    return column * (row.max() + 1) + row, (column + 2 * row) % folds


def plate_pairs(skin: PressedSkin, split: int, count: int, rng: np.random.Generator) -> Pairs:
    """Random pairs of presses of a split with their distance on the plate."""
    rows = np.flatnonzero(skin.split == split)
    first, second = rows[rng.integers(0, len(rows), (2, count))]
    apart = skin.place[first, :PLANE] - skin.place[second, :PLANE]
    return Pairs(first, second, np.linalg.norm(apart, axis=1))


def walks(skin: PressedSkin, count: int, reach: float, rng: np.random.Generator) -> Chains:
    """Random walks over training presses, of `CHAIN_STEPS` displacements along axes on which presses differ.

    `reach`: largest step along an axis in m, before moving to the nearest press there.
    """
    known = np.flatnonzero(skin.split == TRAIN)
    tree = cKDTree(skin.place[known])
    visited = [rng.integers(0, len(known), count)]
    for _ in range(CHAIN_STEPS):
        aims = skin.place[known[visited[-1]]] + rng.uniform(-reach, reach, (count, skin.place.shape[1]))
        visited.append(tree.query(aims)[1])
    rows = known[np.stack(visited, axis=1)]
    actions = np.diff(skin.place[rows], axis=1) / STEP_S
    size = np.sqrt(np.mean(actions**2, axis=(0, 1)))
    return Chains(rows, actions[..., size > STILL * size.max()], np.full(count, STEP_S))


@dataclass(frozen=True)
class TableRuns:
    """Closed loops of S seeds and T trials on the plate."""

    path: np.ndarray  # (steps + 1, S, T, 2) m of the probe
    target: np.ndarray  # (T, 2) m

    def left(self) -> np.ndarray:
        """(steps + 1, S, T) m, remaining distance to the target."""
        return np.linalg.norm(self.path - self.target, axis=-1)

    def arrival(self, tolerance: float) -> np.ndarray:
        """Step (S, T) after which the distance stays within the tolerance; -1 if it does not at the end."""
        outside = self.left() > tolerance
        last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)  # last step outside
        arrived = np.where(outside.any(axis=0), last + 1, 0)
        return np.where(outside[-1], -1, arrived)

    def length_ratio(self, arrival: np.ndarray) -> np.ndarray:
        """Path length (S, T) until arrival over the straight distance; NaN without arrival or motion."""
        steps = np.linalg.norm(np.diff(self.path, axis=0), axis=-1)
        done = np.vstack([np.zeros((1, *arrival.shape)), steps.cumsum(axis=0)])
        step = np.maximum(arrival, 0)[None]
        length = np.take_along_axis(done, step, axis=0)[0]
        end = np.take_along_axis(self.path, step[..., None], axis=0)[0]
        straight = np.linalg.norm(end - self.path[0], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((arrival > 0) & (straight > 0), length / straight, np.nan)


def servo_on_table(
    servo: TactileServo,
    table: PressedSkin,
    starts: np.ndarray,
    targets: np.ndarray,
    steps: int,
    map_alone: bool,
) -> TableRuns:
    """Servo from presses to the readings of other presses.

    `servo`: with one action per step; it moves along as many axes as its actions have, the other coordinates
    stay as at the start, and the probe stays within the table. `starts`, `targets` (T,) rows of the table;
    `map_alone`: servo to the place on the map only, because no action changes the pressure.
    """
    tree = cKDTree(table.place)
    low, high = table.place.min(axis=0), table.place.max(axis=0)
    seeds, axes = len(servo.seeds), len(servo.units.action_scale)

    def felt(rows: np.ndarray) -> np.ndarray:
        return servo.encode(table.signals[rows])

    place = np.tile(table.place[starts], (seeds, 1, 1))  # (S, T, 3)
    target = felt(np.tile(targets, (seeds, 1)))
    latent = felt(np.tile(starts, (seeds, 1)))
    memory = servo.start(latent)
    path = [place[..., :PLANE].copy()]
    for _ in range(steps):
        if map_alone:
            target[..., PLANE:] = latent[..., PLANE:]
        action, memory = servo.act(latent, target, memory)
        place[..., :axes] += STEP_S * action
        place = np.clip(place, low, high)
        path.append(place[..., :PLANE].copy())
        latent = felt(tree.query(place)[1])
    return TableRuns(np.stack(path), table.place[targets, :PLANE])
