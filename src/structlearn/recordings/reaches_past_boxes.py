"""Public recordings of people who reach past boxes in virtual reality.

Files of the repository m-hasan-n/hlp ("Human-like Planning for Reaching in Cluttered Environments", ICRA
2020), in its layout: a table of trials, and per trial the hand at 90 Hz, the boxes and the scene. Unity's
axes are x right, y up, z forward, left-handed; with y and z exchanged they are x right, y forward, z up,
right-handed.
"""

import csv
from pathlib import Path

import numpy as np

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError, MissingInputError
from structlearn.recordings.recording import Form, NamedShape, Recording, Stream
from structlearn.recordings.text_log import check_rising, read_each, read_stamped_table, source_provenance

REPOSITORY = "https://github.com/m-hasan-n/hlp"
COMMIT = "5c1d5f29c3550391376da7e98e27a0006bb67ea5"
LICENCE = "MIT, see LICENSE.md beside the files"

TRIALS = "trials.csv"
TRIAL_COLUMNS = ("participant", "trial", "type", "start_moved_time", "target_reached_time")
SHAPE_COLUMNS = ("object", "x", "y", "z", "width", "height", "depth")
HAND_COLUMNS = 7
"""Time, position, rotation about Unity's axes."""

TARGET, BOX, BOUNDARY = "target", "box", "boundary"
"""What names of shapes begin with; there is one target."""

SOURCE_TARGET, SOURCE_BOX = "Target", "FailOnTouchObstacle"
BOUNDARIES = {f"{side}Boundary": f"{BOUNDARY} {side.lower()}" for side in ("Left", "Right", "Back")}
"""Walls of the shelf that a hand beside the boxes may meet; its floor and its top are above and below."""


def read_reaches_past_boxes(folder: str | Path, left_out: dict[str, str] | None = None) -> list[Recording]:
    """Trials of all people: the hand's pose, boxes, walls and target as named shapes.

    A trial is recorded as a whole; when the hand had moved and when the target was reached (s since the first
    stamp) stands in the provenance, with person, trial and type.

    Args:
        folder: the data set's folder, or any part of it: trials whose folder is missing are passed over. A
            trial's files lie in its folder, or in folders there, as they were published.
        left_out: gets why a file cannot be read; None: that is an error.

    Returns:
        Recordings named PERSON_TRIAL, e.g. "sub_01_T012", in the order of the table of trials.

    Raises:
        MissingInputError: there is no table of trials, or none of its trials.
        InputError: a file is missing, or a row is not what it should be; the message names file and line.
    """
    folder = Path(folder)
    if not (folder / TRIALS).is_file():
        raise MissingInputError(f"{folder}: holds no table of trials ({TRIALS})")
    known = {}
    for line, row in _rows(folder / TRIALS, TRIAL_COLUMNS):
        where = f"{folder / TRIALS}: line {line}"
        number = int(_numbers(where, row, ("trial",))[0])
        times = _numbers(where, row, TRIAL_COLUMNS[3:])
        trial = folder / row["participant"] / f"T{number:03d}"
        if trial.is_dir():
            known[trial] = row, times
    if not known:
        raise MissingInputError(f"{folder}: holds none of the trials of {TRIALS} (sub_01/T012, ...)")
    return read_each(lambda trial: _trial(folder, trial, *known[trial]), known, left_out)


def unity_to_base(points: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of Unity's left-handed axes in the base frame: y and z exchanged."""
    return np.asarray(points, dtype=float)[..., [0, 2, 1]]


def unity_rotation(degrees: np.ndarray) -> np.ndarray:
    """Orientations of Unity's Euler angles in the base frame.

    Unity turns about z, then x, then y. Exchanging two axes is a reflection: it takes a rotation's axis with
    it and turns its sense round.

    Args:
        degrees: (..., 3) about Unity's x, y and z.

    Returns:
        (..., 4) unit quaternions w, x, y, z.
    """
    half = 0.5 * np.radians(degrees)
    about = np.zeros((3, *half.shape[:-1], 4))
    for axis in range(3):
        about[axis, ..., 0] = np.cos(half[..., axis])
        about[axis, ..., axis + 1] = np.sin(half[..., axis])
    turned = quaternion.product(about[1], quaternion.product(about[0], about[2]))
    return np.concatenate([turned[..., :1], -unity_to_base(turned[..., 1:])], axis=-1)


def _trial(folder: Path, trial: Path, row: dict[str, str], times: np.ndarray) -> Recording:
    """Times: (2,) s when the hand had moved, and when the target was reached, on the clock of the stamps."""
    names = ("HandTracker_movement", "grid_objects_layout", "scene_layout")
    hand, boxes, scene = (_within(trial, f"{name}_{trial.name}.csv") for name in names)
    stamps, values = read_stamped_table(hand, HAND_COLUMNS, separator=",", header_lines=1)
    check_rising(hand, stamps)
    pose = np.hstack([unity_to_base(values[:, :3]), unity_rotation(values[:, 3:])])
    provenance = source_provenance(REPOSITORY, COMMIT, LICENCE, folder, [hand, boxes, scene])
    provenance |= {
        "person": row["participant"],
        "trial": row["trial"],
        "type": row["type"],
        **{
            key: f"{at - stamps[0] * 1e-9:.4f}"
            for key, at in zip(("moved_s", "reached_s"), times, strict=True)
        },
    }
    shapes = (*_layout(boxes), *_walls(scene))
    streams = (Stream("/pose", "pose", stamps, pose),)
    return Recording(f"{row['participant']}_{trial.name}", streams, provenance=provenance, shapes=shapes)


def _within(trial: Path, name: str) -> Path:
    """A file of a trial: `movement/NAME`, `scene/NAME`, or NAME, which need not exist."""
    return next(iter(sorted(trial.rglob(name))), trial / name)


def _layout(path: Path) -> list[NamedShape]:
    """The target, a cylinder, and the boxes."""
    shapes = []
    for line, row in _rows(path, SHAPE_COLUMNS):
        if row["object"] == SOURCE_TARGET:
            shapes.append(_shape(path, line, row, TARGET, "cylinder"))
        elif row["object"].startswith(SOURCE_BOX):
            name = f"{BOX} {row['object'].removeprefix(SOURCE_BOX)}"
            shapes.append(_shape(path, line, row, name, "cube"))
        else:
            raise InputError(f"{path}: line {line}: unknown object {row['object']!r}")
    if [shape.name for shape in shapes].count(TARGET) != 1:
        raise InputError(f"{path}: needs one object '{SOURCE_TARGET}'")
    return shapes


def _walls(path: Path) -> list[NamedShape]:
    rows = [(line, row) for line, row in _rows(path, SHAPE_COLUMNS) if row["object"] in BOUNDARIES]
    return [_shape(path, line, row, BOUNDARIES[row["object"]], "cube") for line, row in rows]


def _shape(path: Path, line: int, row: dict[str, str], name: str, form: Form) -> NamedShape:
    values = unity_to_base(_numbers(f"{path}: line {line}", row, SHAPE_COLUMNS[1:]).reshape(2, 3))
    if not (values[1] > 0).all():
        raise InputError(f"{path}: line {line}: a size must be positive, is {values[1].tolist()}")
    return NamedShape(name, form, values[0], np.array([1.0, 0.0, 0.0, 0.0]), values[1])


def _rows(path: Path, columns: tuple[str, ...]) -> list[tuple[int, dict[str, str]]]:
    """Rows of a table with headings, each with its line from 1."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file") from error
    header, *rows = list(csv.reader(lines)) or [[]]
    if missing := [name for name in columns if name not in header]:
        raise InputError(f"{path}: has no column {', '.join(missing)}")
    for line, row in enumerate(rows, start=2):
        if row and len(row) != len(header):
            raise InputError(f"{path}: line {line} has {len(row)} columns, expected {len(header)}")
    return [(line, dict(zip(header, row, strict=True))) for line, row in enumerate(rows, start=2) if row]


def _numbers(where: str, row: dict[str, str], columns: tuple[str, ...]) -> np.ndarray:
    """(C,) finite numbers of a row."""
    values = []
    for name in columns:
        try:
            values.append(float(row[name]))
        except ValueError as error:
            raise InputError(f"{where}: {name} is not a number: {row[name]!r}") from error
    if not np.isfinite(values).all():
        raise InputError(f"{where}: not a finite number in {', '.join(columns)}")
    return np.array(values)
