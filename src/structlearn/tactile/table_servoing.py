"""Tactile servoing on a table of recorded presses: the press that was recorded nearest answers.

A recording cannot be asked what the sensor would read elsewhere, but a dense one knows nearly everywhere. So
a controller that was learned from one run can act on another run, without a robot.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from structlearn.tactile.pressed_skin import PLANE, STEP_S, PressedSkin
from structlearn.tactile.servo_controller import TactileServo


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
