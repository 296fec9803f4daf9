"""Sound files of every kind that the project reads, and how each is read."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pybullet_data
import yaml
from committed import own_tasks, parameter_tree, topic_map
from faults import forged_skills
from faults.mutants import mutant
from mcap.writer import CompressionType
from readers_bags import make_recording, pose_messages, pose_rows, write_bag, write_older
from readers_sets import write_boxes, write_dataset, write_kuka, write_skin, write_ur10e
from scraping_motions import constant_network, scraping_skill

from dissertation.recorded.readers import kuka_lwr4
from dissertation.recorded.readers.eflesh import FOLDERS, PRESSES, read_run
from dissertation.recorded.readers.reaches_past_boxes import read_obstacles
from dissertation.recorded.readers.ur10e import read_motion
from structlearn.core.artefacts import read_metrics, read_table, write_metrics, write_table
from structlearn.core.params import read_parameters
from structlearn.feedback.coupling_model import read_networks, write_networks
from structlearn.primitives.primitive_files import read_primitives, write_primitives
from structlearn.readers import read_demonstrations, read_recording, write_recording
from structlearn.readers.bag_recording import read_joint_log, write_joint_log
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import NamedShape
from structlearn.readers.foreign_tables import read_stamped_table
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table, signals_of, write_log_table
from structlearn.readers.lerobot import read_movement
from structlearn.readers.touch_log import read_touch_table
from structlearn.rigid_body.robot import read_urdf
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.tasks.task_entry import read_task
from structlearn.verify import output_faults, outputs


@dataclass(frozen=True)
class Specimen:
    """One kind of file; one that is signed carries checksums, so that no damage may pass."""

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    signed: bool
    damage: Callable[[bytes, int], tuple[str, bytes]] = mutant


def _log(kind: type, name: str) -> Any:
    """60 samples of the signals of two joints."""
    values = np.random.default_rng(0).normal(size=(len(signals_of(kind)), 60, 2))
    return kind(name, ("a", "b"), 10**9 + 4_000_000 * np.arange(60), *values)


def _scene(path: Path) -> None:
    unturned, size = np.array([1.0, 0.0, 0.0, 0.0]), np.full(3, 0.1)
    forms = ("cube", "sphere", "cylinder")
    shapes = tuple(NamedShape(f"a {form}", form, np.arange(3.0), unturned, size) for form in forms)
    write_recording(replace(make_recording(path.stem, count=20), shapes=shapes), path)


def _bag(path: Path, **options: Any) -> None:
    """As a robot's recorder writes it, with options of the library's writer."""
    stamps = (10**9 + 10_000_000 * np.arange(40)).tolist()
    write_bag(path, pose_messages(stamps, pose_rows(40), "/pose"), **options)


def _older(path: Path) -> None:
    """A bag of ROS 1, or of ROS 2 before MCAP."""
    from rosbags import rosbag1, rosbag2

    stamps = (10**9 + 10_000_000 * np.arange(20)).tolist()
    content = stamps, pose_rows(20), np.zeros((20, 2))
    if path.suffix == ".bag":
        write_older(rosbag1.Writer(path), *content, ros1=True)
    else:
        write_older(rosbag2.Writer(path.parent / "made", version=9), *content, ros1=False)
        (path.parent / "made/made.db3").rename(path)
        shutil.rmtree(path.parent / "made")


def _lock(path: Path) -> None:
    outs = [{"path": f"data/{name}", "md5": "0" * 32, "size": 1} for name in "abc"]
    path.write_text(yaml.safe_dump({"schema": "2.0", "stages": {"write": {"outs": outs}}}))


def _table(path: Path) -> None:
    columns = {"name": np.repeat(["a", "b", "c"], 100), "value": np.random.default_rng(0).normal(size=300)}
    write_table(pd.DataFrame(columns | {"count": range(300)}), path)


def _text(path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(50, 3))
    np.savetxt(path, np.column_stack([np.arange(50) / 100, values]), fmt="%.6f")


def _poses(path: Path) -> None:
    rows = np.column_stack([1.0 + 0.01 * np.arange(40), pose_rows(40)])
    _users(path, pd.DataFrame(rows, columns=["time_s", "x", "y", "z", "qw", "qx", "qy", "qz"]))


def _users(path: Path, table: pd.DataFrame) -> None:
    """A user's table; where it is Parquet, with checksums of its pages."""
    if path.suffix == ".csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False, write_page_checksum=True)


def _described_bag(path: Path) -> None:
    """`path` is the description beside the bag's file."""
    _bag(path.with_name("bag.mcap"))
    path.write_text(yaml.safe_dump({"rosbag2_bagfile_information": {"relative_file_paths": ["bag.mcap"]}}))


def _touches(path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(40, 5))
    _users(path, pd.DataFrame(values, columns=["x_m", "y_m", "time_s", "a", "b"]))


def _dataset(path: Path) -> Path:
    return next(folder for folder in path.parents if folder.name == "lerobot")


def _episodes(path: Path) -> list:
    return read_movement(_dataset(path), SimpleNamespace(topics=topic_map(pose="pose")), {})


def _joints(path: Path) -> None:
    """A table of joints and an output, without a pose."""
    columns = ["time_s", "position.a", "position.b", "output.opening"]
    _users(
        path,
        pd.DataFrame(np.column_stack([1.0 + 0.01 * np.arange(40), pose_rows(40)[:, :3]]), columns=columns),
    )


def _free(path: Path) -> Any:
    named = {"joint_states": ("/joint_states",), "outputs": {"opening": "/output/opening"}}
    return read_demonstrations(path, topic_map(pose=None, **named))


def _tasks(path: Path) -> None:
    moves = [{"name": "move", "axis": "z", "threshold_m_s": 0.02}, {"name": "wipe", "axis": "strokes"}]
    entry = {"source": "x", "topics": {"pose": "/p", "wrench": "/w"}, "segment": {"primitives": moves}}
    feedback = {"executions": "y", "corrections": "z", "settings": [5], "primitives": ["wipe"]}
    entry["feedback"] = feedback | {"axes": ["z"], "sensors": ["wrench"]}
    own_tasks(path.parent, reach=entry)


def _taken(path: Path) -> Any:
    return synchronise(read_recording(path))


SIGNED = {
    "demonstration.mcap": (lambda path: write_recording(make_recording(path.stem, count=30), path), _taken),
    "scene.mcap": (_scene, _taken),
    "lz4.mcap": (
        lambda path: _bag(path, compression=CompressionType.LZ4, chunk_size=2000, enable_data_crcs=True),
        _taken,
    ),
    "log.mcap": (lambda path: write_joint_log(_log(JointLog, path.stem), path), read_joint_log),
    "drives.parquet": (
        lambda path: write_log_table([_log(DriveLog, path.stem)], path),
        lambda path: read_log_table(path, DriveLog),
    ),
    "networks.safetensors": (
        lambda path: write_networks([("tilt", constant_network())], path), read_networks
    ),
    "primitives.safetensors": (
        lambda path: write_primitives(scraping_skill().primitives, path), read_primitives
    ),
    "skill.safetensors": (forged_skills.write, forged_skills.run),
    "strokes.safetensors": (forged_skills.write_strokes, forged_skills.run),
    "joints.safetensors": (forged_skills.write_joints, forged_skills.run),
    "table.parquet": (_table, read_table),
}  # fmt: skip
UNSIGNED = {
    "unchecked.mcap": (lambda path: _bag(path, use_chunking=False, enable_crcs=False), _taken),
    "take.db3, take.bag": (_older, lambda path: read_recording(path, topic_map(pose="/tool"))),
    "poses.csv, poses.parquet": (_poses, read_demonstrations),
    "joints.csv, joints.parquet": (_joints, _free),
    "metadata.yaml": (_described_bag, lambda path: read_demonstrations(path.parent)),
    "metrics.json": (
        lambda path: write_metrics({"error": 0.1, "runs": 3, "model": "cov", "known": True}, path),
        read_metrics,
    ),
    "log.txt": (_text, lambda path: read_stamped_table(path, 4)),
    "ur-run.csv": (
        lambda path: write_ur10e(path.parent, ["ur-run"]), lambda path: read_motion(path.parent)
    ),
    f"{FOLDERS[PRESSES]}/run/states.csv": (
        lambda path: write_skin(path.parents[2], name="run"),
        lambda path: read_run(path.parent, path.parents[2], PRESSES),
    ),
    "sub_01/T007/HandTracker_movement_T007.csv, sub_01/T007/grid_objects_layout_T007.csv": (
        lambda path: write_boxes(path.parents[2]), lambda path: read_obstacles(path.parents[2], None)
    ),
    "dvc.lock": (_lock, lambda path: list(output_faults(outputs(path, path.parent)))),
    "params.yaml": (
        lambda path: path.write_text(yaml.safe_dump({"segment": parameter_tree({})["segment"]})),
        lambda path: read_parameters(path, "segment", SegmentParameters),
    ),
    "structlearn.yaml": (_tasks, lambda path: read_task("reach", path)),
    "touches.csv, touches.parquet": (_touches, lambda path: read_touch_table(path, None)),
    "measurements_1.npz": (
        lambda path: write_kuka(path.parent), lambda path: kuka_lwr4.read_motion(path.parent)
    ),
    "lerobot/meta/info.json, lerobot/data/chunk-000/file-000.parquet": (
        lambda path: write_dataset(_dataset(path)), _episodes
    ),
    "robot.urdf": (
        lambda path: shutil.copy(Path(pybullet_data.getDataPath(), "kuka_iiwa/model.urdf"), path),
        lambda path: read_urdf(path).inertias,
    ),
}  # fmt: skip
"""How files are written and read, by their names; without checksums some damage is other data."""
SPECIMENS = {
    name: Specimen(name, *both, signed=files is SIGNED)
    for files in (SIGNED, UNSIGNED)
    for names, both in files.items()
    for name in names.split(", ")
}
SPECIMENS |= {
    name: Specimen(name, write, forged_skills.run, False, forged_skills.forged)
    for name, write in (
        ("forged.safetensors", forged_skills.write),
        ("forged-strokes.safetensors", forged_skills.write_strokes),
        ("forged-joints.safetensors", forged_skills.write_joints),
    )
}
