"""Public robot recordings of the CLMC laboratory: reaches, unscrewing, and one execution of scraping.

Data files of the repository gsutanto/dmp, in its layout. Values are kept as recorded; in the unscrewing logs,
each tactile value repeats for about three rows, since the sensor is slower than the robot.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.demonstration import Recording, Stream
from structlearn.readers.foreign_tables import (
    LeftOut,
    PublicSet,
    natural_order,
    read_each,
    read_stamped_table,
    read_text_table,
    uniform_stamps,
)

SOURCE = PublicSet(
    "https://github.com/gsutanto/dmp",
    "4f4492cf4295d9c3fe0ba9ce2fb726bf37be40df",
    "MIT, Copyright (c) 2021 Giovanni Sutanto",
)

ROBOT_RATE_HZ = 300.0  # control rate of the unscrewing and scraping logs
ELECTRODES = 19  # of one BioTac finger


def read_movement(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """One part of the repository's data, in natural order; numeric names are zero-padded to equal length.

    `entry.part`: `scraping` or `scraping/TRIAL`, `quat_dmp_unscrewing`, or a folder of reaches in
    `cart_coord_dmp`, which may be a pattern.
    """
    kind, _, name = str(entry.part).partition("/")
    if kind == "scraping":
        found = read_scraping_execution(folder, name or None)
    elif kind == "quat_dmp_unscrewing":
        found = read_unscrewing(folder, left_out)
    else:
        found = read_reaches(folder, str(entry.part).removeprefix("cart_coord_dmp/"), left_out)
    digits = max((len(one.name) for one in found if one.name.isdecimal()), default=0)
    named = {one.name.zfill(digits) if one.name.isdecimal() else one.name: one for one in found}
    return [replace(named[name], name=name) for name in sorted(named, key=natural_order)]


def read_reaches(folder: Path, dataset: str = "dataset1", left_out: LeftOut = None) -> list[Recording]:
    """Reaches of one end-effector, 1000 Hz, named by their number.

    The orientation was not recorded: poses have the identity and twists no rotation, and the provenance says
    so (`"orientation": "not recorded"`), which makes both None in a demonstration. `dataset` is a folder in
    `cart_coord_dmp`, or a pattern, of whose matches the alphabetically first is taken.
    """
    reaches = folder / "cart_coord_dmp" / dataset
    reaches = next(iter(sorted(reaches.parent.rglob(dataset))), reaches)
    files = sorted(
        (path for path in reaches.glob("*.txt") if path.stem.isdecimal()), key=lambda path: int(path.stem)
    )
    if not files:
        raise MissingInputError(f"{reaches}: holds no reaches (1.txt, 2.txt, ...)")
    return read_each(partial(_reach, folder), files, left_out)


def read_unscrewing(folder: Path, left_out: LeftOut = None) -> list[Recording]:
    """Robot logs of unscrewing by one full turn, 300 Hz: pose, twist, wrench, left finger's electrodes.

    Printed times have five digits, up to 0.03 ms off 300 Hz, and are restored; other times are an error.
    """
    logs = folder / "quat_dmp_unscrewing"
    files = sorted(logs.rglob("*.txt"), key=lambda path: natural_order(path.stem))
    if not files:
        raise MissingInputError(f"{logs}: holds no logs (01.txt, 02.txt, ...)")
    return read_each(partial(_unscrewing, folder), files, left_out)


def read_scraping_execution(folder: Path, trial: str | None = None) -> list[Recording]:
    """One robot execution of the scraping primitives on a tilted board, 300 Hz, without times.

    Recordings "prim1", "prim2", ... have pose, twist, joint positions and two fingers' electrodes (left,
    right); each starts at time 0. `trial` is a folder in `scraping`; None: the first that holds primitives.
    """
    scraping = folder / "scraping"
    found = [path for path in scraping.glob(f"{trial or '*'}/prim*") if path.is_dir()]
    if not found:
        raise MissingInputError(f"{scraping / (trial or '')}: holds no execution (prim1, prim2, ...)")
    first = min((path.parent for path in found), key=lambda path: natural_order(path.name))
    primitives = sorted(first.glob("prim*"), key=lambda path: natural_order(path.name))
    return [_primitive(folder, primitive) for primitive in primitives]


def _reach(folder: Path, path: Path) -> Recording:
    stamps, values = read_stamped_table(path, 10)  # time; position, velocity, acceleration
    identity = np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))
    streams = (
        Stream("/pose", "pose", stamps, np.hstack([values[:, :3], identity])),
        Stream("/twist", "twist", stamps, np.hstack([values[:, 3:6], np.zeros((len(stamps), 3))])),
    )
    provenance = SOURCE.provenance(folder, [path]) | {"orientation": "not recorded"}
    return Recording(path.stem, streams, provenance=provenance)


def _unscrewing(folder: Path, path: Path) -> Recording:
    printed, values = read_stamped_table(path, 93)  # column indices below do not count the time
    stamps = uniform_stamps(len(printed), ROBOT_RATE_HZ)
    off = np.abs(printed - stamps) > 100_000  # ns; the last of five digits is 0.1 ms
    if off.any():
        row = int(np.argmax(off))
        raise InputError(
            f"{path}: row {row} has time {printed[row] * 1e-9:.6g} s, "
            f"{ROBOT_RATE_HZ:g} Hz means {stamps[row] * 1e-9:.6g} s"
        )
    streams = (
        Stream("/pose", "pose", stamps, values[:, [0, 1, 2, 9, 10, 11, 12]]),
        Stream("/twist", "twist", stamps, values[:, [3, 4, 5, 13, 14, 15]]),
        Stream("/wrench", "wrench", stamps, values[:, 19:25]),
        Stream("/tactile/0", "tactile", stamps, values[:, 25 : 25 + ELECTRODES]),
    )
    provenance = SOURCE.provenance(folder, [path]) | {"clock": "300 Hz, restored from five printed digits"}
    return Recording(path.stem, streams, provenance=provenance)


def _primitive(folder: Path, primitive: Path) -> Recording:
    columns = {"position": 9, "orientation": 10, "sense_proprio": 7}
    columns |= {"sense_R_LF": ELECTRODES, "sense_R_RF": ELECTRODES}
    tables = {name: read_text_table(primitive / name, width) for name, width in columns.items()}
    position, orientation, joints, left, right = tables.values()
    for name, table in tables.items():
        if len(table) != len(position):
            raise InputError(f"{primitive / name}: has {len(table)} rows, position has {len(position)}")
    stamps = uniform_stamps(len(position), ROBOT_RATE_HZ)
    streams = (
        Stream("/pose", "pose", stamps, np.hstack([position[:, :3], orientation[:, :4]])),
        Stream("/twist", "twist", stamps, np.hstack([position[:, 3:6], orientation[:, 4:7]])),
        Stream("/joint_states/positions", "joint_positions", stamps, joints),
        Stream("/tactile/0", "tactile", stamps, left),
        Stream("/tactile/1", "tactile", stamps, right),
    )
    provenance = SOURCE.provenance(folder, [primitive / name for name in columns])
    provenance["clock"] = "300 Hz, no times in log"
    return Recording(primitive.name, streams, provenance=provenance)
