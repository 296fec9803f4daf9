"""A flat skin that is pressed at known places: what latent spaces and their dynamics are learned from.

Nothing slides here. A press is a sample of its own, and moving on from one press to another that lies near is
an action: the displacement of the probe in one step. On a flat skin geodesics are straight, so that distances
are those on the plate.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from structlearn.tactile.latent_training import CHAIN_STEPS, Pairs
from structlearn.tactile.sensor_description import SensorDescription
from structlearn.tactile.touch_dataset import TRAIN, Chains

STEP_S = 1.0
"""An action's duration: a velocity in m/s is a displacement in m per step."""

PLANE = 2
"""Of a place, the first so many components are on the plate; the third is the height of the probe."""

STILL = 0.01
"""A component of the action that is smaller than this share of the largest (root mean squares) is none."""


ROUNDING = 1e-3
"""Of a block's side: commanded places are exact to tenths of a micrometre only."""


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
    each press is there, from the second on with a gain that drifted.

    Raises:
        InputError: see `SensorDescription.seen`.
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
