"""Public recordings of a magnetic skin, pressed by a probe at known places and with known forces.

Files of the repository notvenky/eFlesh (V. Pattabiraman et al., "eFlesh: highly customizable magnetic touch
sensing using cut-cell microstructures"), folder `characterization/datasets`. The skin's 15 channels and the
probe have separate clocks; each reading is paired with the nearest state of the probe.
"""

from pathlib import Path

import numpy as np

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.foreign_tables import LeftOut, PublicSet, check_rising, read_each, read_stamped_table
from structlearn.readers.touch_log import TouchLog

SOURCE = PublicSet("https://github.com/notvenky/eFlesh", "ab5ca56a87df7cbf59264138998bf74efc216b13", "MIT")

# Channels in the order of the columns: three axes of five magnetometers, and of two skins side by side
CHANNELS = tuple(f"{magnetometer}{axis}" for magnetometer in range(1, 6) for axis in "xyz")
TWO_SKINS = tuple(f"{magnetometer}{axis}" for magnetometer in range(1, 11) for axis in "xyz")

# Kinds of runs: a grid of places; on a scale, up and down at one place; on a scale, along the skin
PRESSES, STROKES, SHEAR = "presses", "strokes", "shear"
FOLDERS = {PRESSES: "spatial_resolution", STROKES: "normal_force", SHEAR: "shear_force"}

STANDARD_GRAVITY = 9.80665  # m/s^2: the scale reads grams
MISSING = -1.0  # logged if the scale gave no reading


def read_touch(folder: Path, entry: object, left_out: dict[str, str]) -> list[TouchLog]:
    """All runs, over places and on a scale, each kind sorted by name, which is a time."""
    found = {kind: read_runs(folder, kind, left_out) for kind in FOLDERS}
    if not found[PRESSES]:
        raise MissingInputError(f"{folder}: holds no run ({FOLDERS[PRESSES]}/RUN/states.csv)")
    return [run for runs in found.values() for run in runs]


def read_runs(folder: Path, kind: str, left_out: LeftOut = None) -> list[TouchLog]:
    """All runs of one kind, a key of `FOLDERS`, sorted by name."""
    paths = sorted(path.parent for path in (folder / FOLDERS[kind]).glob("*/states.csv"))
    return read_each(lambda path: read_run(path, folder, kind), paths, left_out)


def read_run(path: Path, root: Path, kind: str) -> TouchLog:
    """One run of a kind, from a folder below the data set's; on a scale, states end with its reading.

    The resting reading is subtracted from the counts; the place is as commanded, with z pointing away from
    the skin.
    """
    files = [path / "states.csv", path / "sensor_post_baselines.csv"]
    channels = TWO_SKINS if kind == SHEAR else CHANNELS
    stamps, states = read_stamped_table(files[0], 4 if kind == PRESSES else 5, separator=",")
    sensed, counts = read_stamped_table(files[1], 1 + len(channels), separator=",")
    for file, times in zip(files, (stamps, sensed), strict=True):
        check_rising(file, times)
    rows = nearest_rows(stamps, sensed)
    away = np.abs(stamps[rows] - sensed)
    if len(stamps) > 1 and away.max() > np.median(np.diff(stamps)):
        row = int(np.argmax(away))
        raise InputError(
            f"{files[1]}: line {row + 1} is {away[row] * 1e-9:.3f} s from any state in {files[0]}"
        )
    force = None
    if kind != PRESSES:
        grams = states[rows, 3]
        wrong = np.flatnonzero((grams < 0) & (grams != MISSING))
        if len(wrong):
            raise InputError(f"{files[0]}: line {rows[wrong[0]] + 1}: the scale reads {grams[wrong[0]]:g} g")
        force = np.where(grams == MISSING, np.nan, 1e-3 * STANDARD_GRAVITY * grams)
    return TouchLog(
        name=path.name,
        channels=channels,
        counts=counts,
        place=1e-3 * states[rows, :3],
        time=(sensed - sensed[0]) * 1e-9,
        force=force,
        provenance=SOURCE.provenance(root, files),
    )


def nearest_rows(stamps: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Rows of increasing stamps (T,) nearest to other stamps (N,); the earlier of a tie."""
    after = np.searchsorted(stamps, wanted).clip(1, max(len(stamps) - 1, 1))
    after = np.minimum(after, len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(wanted - stamps[before] <= stamps[after] - wanted, before, after)
