"""Public recordings of people reaching past boxes in virtual reality.

Files of the repository m-hasan-n/hlp ("Human-like Planning for Reaching in Cluttered Environments", ICRA
2020), in its layout: a table of trials, and per trial the hand at 90 Hz, the boxes and the scene. Unity's
axes are x right, y up, z forward, left-handed; exchanging y and z gives x right, y forward, z up,
right-handed.
"""

from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.demonstration import Form, NamedShape, Recording, Stream
from structlearn.readers.foreign_tables import (
    LeftOut,
    PublicSet,
    check_rising,
    finite_numbers,
    natural_order,
    read_each,
    read_rows,
    read_stamped_table,
)

SOURCE = PublicSet(
    "https://github.com/m-hasan-n/hlp",
    "5c1d5f29c3550391376da7e98e27a0006bb67ea5",
    "MIT, see LICENSE.md beside the files",
)

TRIALS = "trials.csv"
TRIAL_COLUMNS = ("participant", "trial", "type", "start_moved_time", "target_reached_time")
SHAPE_COLUMNS = ("object", "x", "y", "z", "width", "height", "depth")
HAND_COLUMNS = 7  # time, position, rotation about Unity's axes

TARGET, BOX, BOUNDARY = "target", "box", "boundary"  # prefixes of shape names; there is one target
SOURCE_TARGET, SOURCE_BOX = "Target", "FailOnTouchObstacle"
# Walls of the shelf that a hand beside the boxes may hit; its floor and top are out of reach
BOUNDARIES = {f"{side}Boundary": f"{BOUNDARY} {side.lower()}" for side in ("Left", "Right", "Back")}


def read_obstacles(folder: Path, entry: Any, left_out: LeftOut = None) -> list[Recording]:
    """Trials of all people in natural order: the hand's pose, with boxes, walls and target as named shapes.

    Trials are named like "sub_01_T012"; provenance has the times at which the hand had moved and the target
    was reached (s since the first stamp), and person, trial and type. Trials without a folder are ignored.
    """
    if not (folder / TRIALS).is_file():
        raise MissingInputError(f"{folder}: holds no table of trials ({TRIALS})")
    known = {}
    for where, row in read_rows(folder / TRIALS, TRIAL_COLUMNS):
        number = int(finite_numbers(where, [row["trial"]])[0])
        times = finite_numbers(where, [row[name] for name in TRIAL_COLUMNS[3:]])
        trial = folder / row["participant"] / f"T{number:03d}"
        if trial.is_dir():
            known[trial] = row, times
    if not known:
        raise MissingInputError(f"{folder}: holds none of the trials of {TRIALS} (sub_01/T012, ...)")
    trials = read_each(lambda trial: _trial(folder, trial, *known[trial]), known, left_out)
    return sorted(trials, key=lambda trial: natural_order(trial.name))


def unity_to_base(points: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) from Unity's left-handed axes to the base frame: y and z exchanged."""
    return np.asarray(points, dtype=float)[..., [0, 2, 1]]


def unity_rotation(degrees: np.ndarray) -> np.ndarray:
    """Unity's Euler angles (..., 3) degrees about x, y, z -> (..., 4) unit quaternions in the base frame.

    Unity rotates about z, then x, then y. Exchanging two axes is a reflection, which maps the rotation's axis
    and inverts its sense.
    """
    half = 0.5 * np.radians(degrees)
    about = np.zeros((3, *half.shape[:-1], 4))
    for axis in range(3):
        about[axis, ..., 0] = np.cos(half[..., axis])
        about[axis, ..., axis + 1] = np.sin(half[..., axis])
    turned = quaternion.product(about[1], quaternion.product(about[0], about[2]))
    return np.concatenate([turned[..., :1], -unity_to_base(turned[..., 1:])], axis=-1)


def _trial(folder: Path, trial: Path, row: dict[str, str], times: list[float]) -> Recording:
    """One trial; `times` in s on the stamps' clock: the hand had moved, the target was reached."""
    names = ("HandTracker_movement", "grid_objects_layout", "scene_layout")
    files = [f"{name}_{trial.name}.csv" for name in names]  # in `movement/`, `scene/`, or the trial's folder
    hand, boxes, scene = (next(iter(sorted(trial.rglob(name))), trial / name) for name in files)
    stamps, values = read_stamped_table(hand, HAND_COLUMNS, separator=",", header_lines=1)
    check_rising(hand, stamps)
    pose = np.hstack([unity_to_base(values[:, :3]), unity_rotation(values[:, 3:])])
    provenance = SOURCE.provenance(folder, [hand, boxes, scene])
    provenance |= {"person": row["participant"], "trial": row["trial"], "type": row["type"]}
    for key, at in zip(("moved_s", "reached_s"), times, strict=True):
        provenance[key] = f"{at - stamps[0] * 1e-9:.4f}"
    shapes = (*_shapes(boxes, in_grid=True), *_shapes(scene, in_grid=False))
    streams = (Stream("/pose", "pose", stamps, pose),)
    return Recording(f"{row['participant']}_{trial.name}", streams, provenance=provenance, shapes=shapes)


def _shapes(path: Path, in_grid: bool) -> list[NamedShape]:
    """The target and the boxes of the grid, or the walls of the scene."""
    shapes = []
    for where, row in read_rows(path, SHAPE_COLUMNS):
        form: Form = "cube"
        name = BOUNDARIES.get(row["object"], "")
        if in_grid and row["object"] == SOURCE_TARGET:
            name, form = TARGET, "cylinder"
        elif in_grid and row["object"].startswith(SOURCE_BOX):
            name = f"{BOX} {row['object'].removeprefix(SOURCE_BOX)}"
        elif in_grid:
            raise InputError(f"{where}: unknown object {row['object']!r}")
        if name:
            numbers = finite_numbers(where, [row[column] for column in SHAPE_COLUMNS[1:]])
            position, size = unity_to_base(np.reshape(numbers, (2, 3)))
            if not (size > 0).all():
                raise InputError(f"{where}: a size must be positive, is {size.tolist()}")
            shapes.append(NamedShape(name, form, position, np.array([1.0, 0.0, 0.0, 0.0]), size))
    if in_grid and [shape.name for shape in shapes].count(TARGET) != 1:
        raise InputError(f"{path}: needs one object '{SOURCE_TARGET}'")
    return shapes
