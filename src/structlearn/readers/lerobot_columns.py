"""Columns of a LeRobotDataset's features, as a topic names them, in the order in which signals have them.

A topic is a feature, `observation.state`, or columns of it, by place or by name: `observation.state[0:7]`,
`observation.state[x, y, z, qw, qx, qy, qz]`. Public sets name columns by lists, lists in lists, groups
(`{"motors": [..]}`), places (`{"x": 0, ..}`) or not at all. Names that say what a column is decide its order;
if they do not, the columns are taken in the order given.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.readers.lerobot_frames import FILE, FRAME, INFO

SELECTION = re.compile(r"(.+?)\[([^][]+)\]")
POSITION, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")

# What a name says of its column: what is before it, and the axis. x, eef_x, left.pos_x; qw, quat_w, tcp.rot.w
POSITION_NAME = re.compile(r"(|.*[^a-z0-9])(?:p|pos|position|trans|translation)?[^a-z0-9]?([xyz])(?:\.pos)?")
TURN_NAME = re.compile(
    r"(|.*[^a-z0-9])(?:q|quat|quaternion|ori|orn|orientation|rot|rotation)[^a-z0-9]?([wxyz])"
)
WRENCH_NAME = re.compile(r"(|.*[^a-z0-9])(f|force|t|tau|torque|m|moment)[^a-z0-9]?([xyz])")
# Other vectors along x, y, z, and orientations in a form that is not read
OTHER_VECTOR = re.compile(
    r"vel|acc|speed|delta|force|torque|wrench|gyro|imu|axis|angle|aa|rot|ori|euler|goal"
)
OTHER_TURN = re.compile(
    r"(^|[^a-z])(roll|pitch|yaw|r[xyz]|w[xyz])|axis_?angle|euler|rot|(^|[^a-z])(aa|r[0-9])"
)

POSITIONS = ".pos"  # suffix of joint positions
OTHER_FIELDS = (".vel", ".velocity", ".torque", ".effort", ".current")  # suffixes of what joints have besides


class Columns(NamedTuple):
    """Columns of one feature."""

    feature: str
    places: tuple[int, ...]
    names: tuple[str, ...]  # empty: the set does not name them

    def named(self, names: Sequence[str], places: Sequence[int]) -> "Columns":
        """Some of the columns, under other names."""
        return Columns(self.feature, tuple(self.places[place] for place in places), tuple(names))


def feature_of(features: Mapping[str, Any], topic: str) -> str:
    """Feature that a topic is, or of which it selects columns. Raises InputError: none of numbers."""
    selected = SELECTION.fullmatch(topic)
    name = topic if topic in features or selected is None else selected[1].strip()
    if name not in features:
        raise InputError(f"has no feature {name}; it has {', '.join(features)}")
    if (kind := features[name].get("dtype")) in ("video", "image", "string"):
        raise InputError(f"{name} is a feature of {kind}s, not of numbers")
    return name


def flat_names(names: Any) -> tuple[str, ...]:
    """Names of columns from any of the forms in which sets give them; empty if there are none.

    Raises TypeError: it has another form.
    """
    if isinstance(names, Mapping):
        if names and all(type(place) is int for place in names.values()):
            return tuple(sorted(map(str, names), key=lambda name: names[name]))
        parts = {group: flat_names(part) for group, part in names.items()}
        flat = [name for part in parts.values() for name in part]
        if len(set(flat)) == len(flat):
            return tuple(flat)
        return tuple(f"{group}.{name}" for group, part in parts.items() for name in part)
    if isinstance(names, list | tuple):
        words = (str(part) if type(part) is int else part for part in names)  # columns named by numbers
        return tuple(name for part in words for name in flat_names(part))
    if names is None or isinstance(names, str):
        return () if names is None else (names,)
    raise TypeError(f"names of columns are {names!r}")


def table_of(frames: pd.DataFrame, feature: str) -> np.ndarray:
    """(T, D) values of a feature with one number or list of numbers, also nested, per frame.

    Raises ValueError: a frame has something else, or another number of values than the first one.
    """
    column = frames[feature]
    if pd.api.types.is_numeric_dtype(column):
        return column.to_numpy(float)[:, None]
    rows = []
    for row, value in enumerate(column):
        try:
            values = np.asarray(value.tolist() if isinstance(value, np.ndarray) else value, dtype=float)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{_at(frames, row)}: {feature} is not made of numbers: {error}") from error
        rows.append(values.reshape(-1))
        if len(rows[row]) != len(rows[0]):
            raise ValueError(f"{_at(frames, row)}: {feature} has {len(rows[row])} values, not {len(rows[0])}")
    return np.stack(rows)


def columns_of(features: Mapping[str, Any], topic: str, width: int) -> Columns:
    """Columns that a topic names, of a feature with `width` columns.

    Raises InputError: there is no such column; or the feature has another number of columns than names or,
    without names, than its shape says.
    """
    feature = feature_of(features, topic)
    names = flat_names(features[feature].get("names"))
    if len(names) == 1 < width:  # of the whole vector
        names = ()
    if names and len(names) != width:
        raise InputError(f"{INFO} names {len(names)} columns of {feature}, but it has {width}")
    if not names and (fault := shape_fault(features, feature, width)):
        raise InputError(fault)
    if topic == feature:
        return Columns(feature, tuple(range(width)), names)
    places: list[int] = []
    for word in map(str.strip, SELECTION.fullmatch(topic)[2].split(",")):  # type: ignore[index]
        bounds = re.fullmatch(r"(\d*)(:?)(\d*)", word)
        if word in names:
            places.append(names.index(word))
        elif bounds and word:
            first, colon, last = bounds.groups()
            chosen = (
                range(int(first or 0), int(last or width)) if colon else range(int(first), int(first) + 1)
            )
            if not chosen or chosen[-1] >= width:
                raise InputError(f"{topic}: {feature} has {width} columns, from 0 on, and not {word}")
            places += chosen
        else:
            raise InputError(
                f"{topic}: {feature} has no column {word}; it has {', '.join(names) or 'no names'}"
            )
    if len(set(places)) < len(places):
        raise InputError(f"{topic}: a column is chosen twice")
    return Columns(feature, tuple(places), tuple(names[place] for place in places) if names else ())


def shape_fault(features: Mapping[str, Any], feature: str, width: int) -> str:
    """How the shape that a set states differs from the feature's width; empty if it does not."""
    shape = features[feature].get("shape")
    if not isinstance(shape, list | tuple) or not all(isinstance(size, int) for size in shape):
        return ""
    if int(np.prod(shape, dtype=object)) == width:
        return ""
    return f"{INFO} says that {feature} has the shape {list(shape)}, but it has {width} columns"


def pose_columns(topic: str, columns: Columns) -> Columns:
    """Columns of a position or a pose, as x, y, z and maybe qw, qx, qy, qz.

    Raises InputError: it is not clear which these are.
    """
    count, whole = len(columns.places), topic == columns.feature
    ways = named_poses(columns.names)
    if len(ways) > 1:
        offers = " or ".join(selection(columns, places) for places in ways)
        raise InputError(f"{topic} has several positions: {offers}")
    if ways:
        places = ways[0]
        others = [columns.names[place] for place in range(count) if place not in places]
        if len(places) == 3 and (turns := [name for name in others if OTHER_TURN.search(name.lower())]):
            raise InputError(
                f"{topic} has its orientation as {', '.join(turns)}, and only {', '.join(TURN)} are read; "
                f"{selection(columns, places)} is the position alone"
            )
        return columns.named((*POSITION, *TURN)[: len(places)], places)
    if (columns.names and whole) or count not in (3, 7):
        listing = (
            f"the columns {', '.join(columns.names)}" if columns.names else f"{count} columns without names"
        )
        raise InputError(
            f"{topic} has {listing}, not {', '.join((*POSITION, *TURN))}; `{columns.feature}[..]` names or "
            "numbers those, from 0 on"
        )
    if whole and count == 7:
        raise InputError(
            f"{topic} has 7 columns without names: {topic}[0:7] if qw is the fourth, {topic}[0:3, 6, 3:6] if "
            "it is the last"
        )
    return columns.named((*POSITION, *TURN)[:count], range(count))


def named_poses(names: Sequence[str]) -> list[list[int]]:
    """Places of x, y, z and, if there, qw, qx, qy, qz, of each pose that names tell."""
    positions, turns = dict[str, dict[str, int]](), dict[str, dict[str, int]]()
    for place, name in enumerate(map(str.lower, names)):
        if turn := TURN_NAME.fullmatch(name):
            turns.setdefault(turn[1], {}).setdefault(f"q{turn[2]}", place)
        elif (position := POSITION_NAME.fullmatch(name)) and not OTHER_VECTOR.search(position[1]):
            positions.setdefault(position[1], {}).setdefault(position[2], place)
    whole = {before: axes for before, axes in positions.items() if set(axes) == set(POSITION)}
    turned = {before: axes for before, axes in turns.items() if set(axes) == set(TURN)}
    poses = []
    for before, axes in whole.items():
        turn_axes = next(iter(turned.values())) if len(whole) == len(turned) == 1 else turned.get(before, {})
        poses.append([axes[axis] for axis in POSITION] + [turn_axes[axis] for axis in TURN if turn_axes])
    return poses


def wrench_columns(topic: str, columns: Columns) -> Columns:
    """Columns of force and torque, as fx, fy, fz, tx, ty, tz. Raises InputError: names say something else."""
    found: dict[str, int] = {}
    for place, name in enumerate(map(str.lower, columns.names)):
        if part := WRENCH_NAME.fullmatch(name):
            found.setdefault(f"{'f' if part[2][0] == 'f' else 't'}{part[3]}", place)
    if set(found) == set(WRENCH):
        return columns.named(WRENCH, [found[name] for name in WRENCH])
    if found or named_poses(columns.names) or len(columns.places) != len(WRENCH):
        listing = ", ".join(columns.names) or f"{len(columns.places)} columns without names"
        raise InputError(f"{topic} has {listing}, not {', '.join(WRENCH)}")
    return columns


def joint_columns(topic: str, columns: Columns) -> Columns:
    """Columns of joint positions under the joints' names; without names, these are the columns' numbers.

    Raises InputError: these are a pose.
    """
    if any(len(places) == len(columns.places) for places in named_poses(columns.names)):
        raise InputError(f"{topic} has {', '.join(columns.names)}, which are no joints")
    names = columns.names or tuple(map(str, columns.places))
    kept = [place for place, name in enumerate(names) if not name.endswith(OTHER_FIELDS)]
    return columns.named([names[place].removesuffix(POSITIONS) for place in kept], kept)


def selection(columns: Columns, places: Sequence[int]) -> str:
    """Topic of some of the columns, by name, or by number if names have signs with a meaning in topics."""
    plain = all(re.fullmatch(r"[^][,:]+", name) for name in columns.names)
    words = [columns.names[place] if plain else str(columns.places[place]) for place in places]
    return f"{columns.feature}[{', '.join(words)}]"


def _at(frames: pd.DataFrame, row: int) -> str:
    return f"{frames[FILE].iloc[row]}: frame {frames[FRAME].iloc[row]}"
