"""Sound files of every kind that the project reads, and how each is read."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pybullet_data
import yaml
from committed import parameter_tree
from recordings_bags import make_recording
from scraping_motions import constant_network

from structlearn.feedback.pmnn import read_networks, write_networks
from structlearn.ground.artefacts import read_metrics, read_table, write_metrics, write_table
from structlearn.ground.params import read_parameters
from structlearn.recordings.bag_recording import read_recording
from structlearn.recordings.clock import synchronise
from structlearn.recordings.joint_log import JointLog, read_joint_log, write_joint_log
from structlearn.recordings.mcap_file import write_recording
from structlearn.recordings.text_log import read_stamped_table
from structlearn.rigid_body.tree import read_urdf
from structlearn.segmentation.parameters import SegmentParameters


@dataclass(frozen=True)
class Specimen:
    """One kind of file.

    Attributes:
        name: of the file, with its suffix.
        write: writes a sound one at a path.
        read: reads it as stages do.
        signed: whether it carries checksums, so that no damage may pass.
    """

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    signed: bool


def _log(path: Path) -> None:
    rng = np.random.default_rng(0)
    names = tuple(f"joint_{number}" for number in range(1, 8))
    stamps = 10**9 + 4_000_000 * np.arange(60)
    values = np.cumsum(1e-3 * rng.normal(size=(3, 60, 7)), axis=1)
    write_joint_log(JointLog(path.stem, names, stamps, *values), path)


def _table(path: Path) -> None:
    rng = np.random.default_rng(0)
    names = np.repeat(["a", "b", "c"], 100)
    write_table(pd.DataFrame({"name": names, "value": rng.normal(size=300), "count": range(300)}), path)


def _text(path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = np.hstack([np.arange(50)[:, None] / 100, rng.normal(size=(50, 3))])
    np.savetxt(path, rows, fmt="%.6f")


def _parameters(path: Path) -> None:
    path.write_text(yaml.safe_dump({"segment": parameter_tree({})["segment"]}))


def _metrics(path: Path) -> None:
    write_metrics({"error": 0.1, "runs": 3, "model": "cov", "known": True}, path)


def _urdf(path: Path) -> None:
    path.write_bytes(Path(pybullet_data.getDataPath(), "kuka_iiwa/model.urdf").read_bytes())


SPECIMENS = {
    specimen.name: specimen
    for specimen in (
        Specimen(
            "demonstration.mcap",
            lambda path: write_recording(make_recording(path.stem, count=30), path),
            lambda path: synchronise(read_recording(path)),
            True,
        ),
        Specimen("log.mcap", _log, read_joint_log, True),
        Specimen(
            "networks.safetensors",
            lambda path: write_networks([("tilt", constant_network())], path),
            read_networks,
            True,
        ),
        Specimen("table.parquet", _table, read_table, True),
        Specimen("metrics.json", _metrics, read_metrics, False),
        Specimen("log.txt", _text, lambda path: read_stamped_table(path, 4), False),
        Specimen(
            "params.yaml",
            _parameters,
            lambda path: read_parameters(path, "segment", SegmentParameters),
            False,
        ),
        Specimen("robot.urdf", _urdf, lambda path: read_urdf(path).inertias, False),
    )
}
"""By name."""
