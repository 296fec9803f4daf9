"""Public recordings of a BioTac finger that a KUKA iiwa slides over materials.

Files of the repository dexrob/BioTac_slide_20_50 (R. Gao et al., "Supervised autoencoder joint learning on
heterogeneous tactile sensory data"): six streams per trial, each with its own Unix times.
"""

from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import MissingInputError
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import Recording, Stream
from structlearn.readers.foreign_tables import PublicSet, natural_order, read_each, read_stamped_table
from structlearn.readers.joint_log import JointLog
from structlearn.tasks.touch.touch_names import material_of

SOURCE = PublicSet(
    "https://github.com/dexrob/BioTac_slide_20_50",
    "c19638b040791b7b32f2fcf12eee315ca901f80a",
    "none stated: for tests and evaluation, not for redistribution",
)
JOINTS = tuple(f"lbr_iiwa_joint_{number}" for number in range(1, 8))  # as in the arm's URDF
COLUMNS = {"cp": 8, "jp": 8, "jv": 8, "jt": 8, "cw": 7, "bio": 45}  # per stream of a trial, with the time
FIRST_ELECTRODE = 25  # preceded by time, pressures, temperatures and 22 vibrations


def read_touch(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """The first `entry.part` slides over each material."""
    return read_slides(folder, entry.part, left_out)


def read_slides(
    folder: str | Path, trials: int | None = None, left_out: dict[str, str] | None = None
) -> list[Recording]:
    """The first trials of each material: pose, joint signals, wrench and 19 electrodes, by Unix time.

    The folder contains MATERIAL_TRIAL_STREAM.csv files, or folders of them; names are like "mat9_1".
    """
    found = {path.stem.removesuffix("_cp"): path.parent for path in Path(folder).rglob("*_*_cp.csv")}
    by_material: dict[str, list[str]] = {}
    for name in sorted(found, key=natural_order):
        by_material.setdefault(material_of(name), []).append(name)
    if not found:
        raise MissingInputError(f"{folder}: holds no trials (mat9_1_cp.csv, ...)")
    paths = [found[name] / name for names in by_material.values() for name in names[:trials]]
    return read_each(lambda path: read_slide(path.parent, path.name), paths, left_out)


def read_motion(folder: str | Path, entry: Any, left_out: dict[str, str] | None = None) -> list[JointLog]:
    """Joint logs of the arm on the slides, `entry.part` trials of each material, at `entry.rate_hz`."""
    logs = []
    for recording in read_slides(folder, entry.part, left_out):
        run = synchronise(recording, entry.rate_hz)
        signals = [getattr(run, f"joint_{name}") for name in ("positions", "velocities", "torques")]
        stamps = np.round(1e9 * run.time).astype(np.int64)
        logs.append(JointLog(run.name, JOINTS, stamps, *signals, provenance=run.provenance))
    return logs


def read_slide(folder: Path, name: str) -> Recording:
    """One trial, e.g. "mat9_1", from its six files in a folder; see `read_slides`."""
    files = {stream: folder / f"{name}_{stream}.csv" for stream in COLUMNS}
    tables = {
        stream: read_stamped_table(path, COLUMNS[stream], separator=",", header_lines=1)
        for stream, path in files.items()
    }
    pose_stamps, pose = tables["cp"]
    tactile_stamps, tactile = tables["bio"]
    streams = (
        Stream("/pose", "pose", pose_stamps, np.hstack([pose[:, :3], quaternion.from_xyzw(pose[:, 3:])])),
        Stream("/joint_states/positions", "joint_positions", *tables["jp"]),
        Stream("/joint_states/velocities", "joint_velocities", *tables["jv"]),
        Stream("/joint_states/torques", "joint_torques", *tables["jt"]),
        Stream("/wrench", "wrench", *tables["cw"]),
        Stream("/tactile/0", "tactile", tactile_stamps, tactile[:, FIRST_ELECTRODE:]),
    )
    provenance = SOURCE.provenance(folder, list(files.values()))
    return Recording(name, streams, provenance=provenance)
