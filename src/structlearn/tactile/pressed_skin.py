"""A flat skin that is pressed at known places: what latent spaces and their dynamics are learned from.

Nothing slides here. A press is a sample of its own, and moving on from one press to another that lies near is
an action: the displacement of the probe in one step. On a flat skin geodesics are straight, so that distances
are those on the plate.

A recording cannot be asked what the sensor would read elsewhere, but a dense one knows nearly everywhere. So
a controller that was learned from one run can act on another run, without a robot: the press that was
recorded nearest answers.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from structlearn.tactile.latent_parameters import SensorDescription
from structlearn.tactile.latent_training import CHAIN_STEPS, Pairs
from structlearn.tactile.servo_controller import TactileServo
from structlearn.tactile.touch_dataset import TRAIN, Chains

STEP_S = 1.0  # an action's duration: a velocity in m/s is a displacement in m per step
PLANE = 2  # of a place, the first so many components are on the plate; the third is the height of the probe

STILL = 0.01
"""A component of the action that is smaller than this share of the largest (root mean squares) is none."""


ROUNDING = 1e-3  # of a block's side: commanded places are exact to tenths of a micrometre only


@dataclass(frozen=True)
class PressedSkin:
    """N presses, as `touch_dataset.TouchSamples`."""

    signals: np.ndarray  # (N, E) as `SensorDescription.seen` gives them
    pressure: np.ndarray  # (N,)
    place: np.ndarray  # (N, 3) m of the probe
    split: np.ndarray  # (N,) `TRAIN` or `TEST`


def pressed_skin(
    sensor: SensorDescription,
    counts: np.ndarray,
    place: np.ndarray,
    split: np.ndarray,
    copies: int = 1,
    rng: np.random.Generator | None = None,
) -> PressedSkin:
    """Presses as the sensor's description lets them be seen.

    `counts` (N, E) readings; `place` (N, 3) m of the probe; `split` (N,) of each press; `copies`: times that
    each press is there, from the second on with a gain that drifted. Raises InputError: see
    `SensorDescription.seen`.
    """
    if copies != 1:
        assert rng is not None, "gains are drawn"
        counts = sensor.drifted(counts, copies, rng)
    signals, pressure = sensor.seen(counts)
    return PressedSkin(signals, pressure, np.tile(place, (copies, 1)), np.tile(split, copies))


def block_numbers(place: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Blocks of a plate; what is left over at the far edges belongs to the last ones.

    `place` (N, 2) m; `side`: m of a block. Returns (N,) column and (N,) row of each place's block, from 0.
    """
    start, extent = place.min(axis=0), np.ptp(place, axis=0)
    count = np.maximum(np.floor(extent / side + ROUNDING), 1)
    found = np.minimum(np.floor((place - start) / side + ROUNDING), count - 1).astype(int)
    return found[:, 0], found[:, 1]


def held_out(place: np.ndarray, side: float, folds: int) -> tuple[np.ndarray, np.ndarray]:
    """Blocks and the folds that hold them out: no two neighbours at once, nor all corners.

    `place` (N, 2) m; `side`: m of a block; `folds`: F >= 4 keeps neighbours apart. Returns `block` (N,)
    numbers; `fold` (N,) 0 to F - 1.
    """
    column, row = block_numbers(place, side)
    return column * (row.max() + 1) + row, (column + 2 * row) % folds


def plate_pairs(skin: PressedSkin, split: int, count: int, rng: np.random.Generator) -> Pairs:
    """Random pairs of presses of a split with their distance on the plate."""
    rows = np.flatnonzero(skin.split == split)
    first, second = rows[rng.integers(0, len(rows), (2, count))]
    apart = skin.place[first, :PLANE] - skin.place[second, :PLANE]
    return Pairs(first, second, np.linalg.norm(apart, axis=1))


def walks(skin: PressedSkin, count: int, reach: float, rng: np.random.Generator) -> Chains:
    """Random walks from training press to training press.

    `reach`: m, of a step along each axis at most, but for the distance to the nearest press there. Returns:
    Chains of `CHAIN_STEPS` displacements along those axes along which presses differ.
    """
    taught = np.flatnonzero(skin.split == TRAIN)
    tree = cKDTree(skin.place[taught])
    visited = [rng.integers(0, len(taught), count)]
    for _ in range(CHAIN_STEPS):
        aims = skin.place[taught[visited[-1]]] + rng.uniform(-reach, reach, (count, skin.place.shape[1]))
        visited.append(tree.query(aims)[1])
    rows = taught[np.stack(visited, axis=1)]
    actions = np.diff(skin.place[rows], axis=1) / STEP_S
    size = np.sqrt(np.mean(actions**2, axis=(0, 1)))
    return Chains(rows, actions[..., size > STILL * size.max()], np.full(count, STEP_S))


@dataclass(frozen=True)
class TableRuns:
    """Closed loops of S seeds and T trials on the plate."""

    path: np.ndarray  # (steps + 1, S, T, 2) m of the probe
    target: np.ndarray  # (T, 2) m

    def left(self) -> np.ndarray:
        """(steps + 1, S, T) m to the target."""
        return np.linalg.norm(self.path - self.target, axis=-1)

    def arrival(self, tolerance: float) -> np.ndarray:
        """Step (S, T) from which on the target stays within the tolerance; -1 where it is not at the end."""
        outside = self.left() > tolerance
        last = len(outside) - 1 - np.argmax(outside[::-1], axis=0)  # the last step outside
        arrived = np.where(outside.any(axis=0), last + 1, 0)
        return np.where(outside[-1], -1, arrived)

    def length_ratio(self, arrival: np.ndarray) -> np.ndarray:
        """Way (S, T) until arrival over the straight one to where it arrived; NaN without arrival or way."""
        done = np.vstack(
            [
                np.zeros((1, *arrival.shape)),
                np.linalg.norm(np.diff(self.path, axis=0), axis=-1).cumsum(axis=0),
            ]
        )
        step = np.maximum(arrival, 0)[None]
        way = np.take_along_axis(done, step, axis=0)[0]
        end = np.take_along_axis(self.path, step[..., None], axis=0)[0]
        straight = np.linalg.norm(end - self.path[0], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where((arrival > 0) & (straight > 0), way / straight, np.nan)


def servo_on_table(
    servo: TactileServo,
    table: PressedSkin,
    starts: np.ndarray,
    targets: np.ndarray,
    steps: int,
    map_alone: bool,
) -> TableRuns:
    """Servo from presses to what other presses felt like.

    `servo`: learned from this skin, with one action per step; it moves along as many axes as its actions
    have, the others stay as they were at the start. A probe at the edge of the table stays there; `starts`
    (T,) rows of the table; `targets` (T,) rows of the table; `map_alone`: whether only the place on the map
    is servoed to; the pressure is taken as it comes, as where no action changes it.
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
