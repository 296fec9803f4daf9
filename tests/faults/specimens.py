"""Sound files of every kind that the project reads, and how each is read."""

import json
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
from readers_bags import Older, make_recording, pose_messages, pose_rows, write_bag
from scraping_motions import constant_network, scraping_skill

from structlearn.core.artefacts import read_metrics, read_table, write_metrics, write_table
from structlearn.core.params import read_parameters
from structlearn.feedback.coupling_model import read_networks, write_networks
from structlearn.primitives.primitive_files import read_primitives, write_primitives
from structlearn.readers import kuka_lwr4, read_demonstrations, read_recording, write_recording
from structlearn.readers.bag_recording import read_joint_log, write_joint_log
from structlearn.readers.clock import synchronise
from structlearn.readers.demonstration import NamedShape
from structlearn.readers.eflesh import CHANNELS, FOLDERS, PRESSES, read_run
from structlearn.readers.foreign_tables import read_stamped_table
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table, write_log_table
from structlearn.readers.lerobot import read_movement
from structlearn.readers.reaches_past_boxes import TRIALS, read_obstacles
from structlearn.readers.ur10e import read_motion
from structlearn.readers.user_tables import read_touch_table
from structlearn.rigid_body.tree import read_urdf
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.tasks.task_entry import read_task
from structlearn.verify import changed


@dataclass(frozen=True)
class Specimen:
    """One kind of file; one that is signed carries checksums, so that no damage may pass."""

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    signed: bool
    damage: Callable[[bytes, int], tuple[str, bytes]] = mutant


def _log(kind: type, name: str, signals: int) -> Any:
    """60 samples of seven joints."""
    steps = 1e-3 * np.random.default_rng(0).normal(size=(signals, 60, 7))
    names = tuple(f"joint_{number}" for number in range(1, 8))
    return kind(name, names, 10**9 + 4_000_000 * np.arange(60), *np.cumsum(steps, axis=1))


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
    bag = Older(stamps, pose_rows(20), np.zeros((20, 2)), ros1=path.suffix == ".bag")
    if bag.ros1:
        bag.write(rosbag1.Writer(path))
    else:
        bag.write(rosbag2.Writer(path.parent / "made", version=9))
        (path.parent / "made/made.db3").rename(path)
        shutil.rmtree(path.parent / "made")


def _drive_text(path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(20, 30))
    np.savetxt(path, np.column_stack([200 + 0.01 * np.arange(20), values]), fmt="%.6f", delimiter=",")


def _skin(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    rng, times = np.random.default_rng(0), 1_700_000_000.0 + 0.1 * np.arange(30)
    for name, columns in (("states.csv", 3), ("sensor_post_baselines.csv", len(CHANNELS))):
        rows = np.column_stack([times, rng.normal(size=(30, columns))])
        np.savetxt(path.with_name(name), rows, fmt="%.6f", delimiter=",")


def _reach(path: Path) -> None:
    """A trial of the hand; `path` is one of its files."""
    path.parent.mkdir(parents=True, exist_ok=True)
    trials = "participant,trial,type,start_moved_time,target_reached_time\nsub_01,7,main,100.02,100.15\n"
    hand = "time,pos_x,pos_y,pos_z,rot_x,rot_y,rot_z\n"
    hand += "".join(f"{100 + 0.01 * row:.4f},{0.1 + 0.01 * row:.3f},0.2,-0.3,0,90,0\n" for row in range(20))
    shape = "object,x,y,z,width,height,depth\n"
    boxes = "Target,0,0.8,0.2,0.05,0.09,0.06\nFailOnTouchObstacleLong-1,0.1,0.79,-0.1,0.15,0.12,0.05\n"
    scene = "TableTop,0,0.7,0,1,0.1,1\nLeftBoundary,-0.36,0.8,0,0.02,0.13,0.6\n"
    (path.parents[2] / TRIALS).write_text(trials)
    (path.parent / "HandTracker_movement_T007.csv").write_text(hand)
    (path.parent / "grid_objects_layout_T007.csv").write_text(shape + boxes)
    (path.parent / "scene_layout_T007.csv").write_text(shape + scene)


def _reaches(path: Path) -> list:
    return read_obstacles(path.parents[2], None)


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


def _archive(path: Path) -> None:
    """A log of joints as arrays of numpy."""
    values = {name: np.arange(210.0).reshape(30, 7) for name in ("positions", "velocities", "torques")}
    np.savez_compressed(path, times=1e9 + 0.005 * np.arange(30), **values)


def _episodes(path: Path) -> None:
    """A dataset of two episodes; `path` is one of its files."""
    frames = _dataset(path) / "data/chunk-000/file-000.parquet"
    about = _dataset(path) / "meta/info.json"
    features = {"pose": {"dtype": "float64", "shape": [3], "names": ["x", "y", "z"]}}
    info = {"codebase_version": "v3.0", "fps": 50, "total_episodes": 2, "features": features}
    for one in (frames, about):
        one.parent.mkdir(parents=True, exist_ok=True)
    about.write_text(json.dumps(info))
    table = {"episode_index": np.repeat([0, 1], 20), "frame_index": np.tile(np.arange(20), 2)}
    pd.DataFrame(table | {"pose": list(pose_rows(40)[:, :3])}).to_parquet(frames, index=False)


def _dataset(path: Path) -> Path:
    return next(folder for folder in path.parents if folder.name == "lerobot")


def _demonstrated(path: Path) -> list:
    return read_movement(_dataset(path), SimpleNamespace(topics=topic_map(pose="pose")), {})


def _tasks(path: Path) -> None:
    own_tasks(path.parents[2], reach={"source": "x", "topics": {"pose": "/p"}, **MOVE})


TOOL = topic_map(pose="/tool")
MOVE = {"segment": {"primitives": [{"name": "move", "axis": "z", "threshold_m_s": 0.02}]}}


def _taken(path: Path) -> Any:
    return synchronise(read_recording(path))


SIGNED = {
    "demonstration.mcap": (lambda path: write_recording(make_recording(path.stem, count=30), path), _taken),
    "scene.mcap": (_scene, _taken),
    "log.mcap": (lambda path: write_joint_log(_log(JointLog, path.stem, 3), path), read_joint_log),
    "drives.parquet": (
        lambda path: write_log_table([_log(DriveLog, path.stem, 5)], path),
        lambda path: read_log_table(path, DriveLog),
    ),
    "lz4.mcap": (
        lambda path: _bag(path, compression=CompressionType.LZ4, chunk_size=2000, enable_data_crcs=True),
        _taken,
    ),
    "networks.safetensors": (
        lambda path: write_networks([("tilt", constant_network())], path),
        read_networks,
    ),
    "primitives.safetensors": (
        lambda path: write_primitives(scraping_skill().primitives, path),
        read_primitives,
    ),
    "skill.safetensors": (forged_skills.write, forged_skills.run),
    "table.parquet": (_table, read_table),
}
UNSIGNED = {
    "unchecked.mcap": (lambda path: _bag(path, use_chunking=False, enable_crcs=False), _taken),
    **dict.fromkeys(("take.db3", "take.bag"), (_older, lambda path: read_recording(path, TOOL))),
    **dict.fromkeys(("poses.csv", "poses.parquet"), (_poses, read_demonstrations)),
    "metadata.yaml": (_described_bag, lambda path: read_demonstrations(path.parent)),
    "metrics.json": (
        lambda path: write_metrics({"error": 0.1, "runs": 3, "model": "cov", "known": True}, path),
        read_metrics,
    ),
    "log.txt": (_text, lambda path: read_stamped_table(path, 4)),
    "ur-run.csv": (_drive_text, lambda path: read_motion(path.parent)),
    f"{FOLDERS[PRESSES]}/run/states.csv": (
        _skin,
        lambda path: read_run(path.parent, path.parents[2], PRESSES),
    ),
    "sub_01/T007/HandTracker_movement_T007.csv": (_reach, _reaches),
    "sub_01/T007/grid_objects_layout_T007.csv": (_reach, _reaches),
    "dvc.lock": (_lock, lambda path: list(changed(path, path.parent))),
    "params.yaml": (
        lambda path: path.write_text(yaml.safe_dump({"segment": parameter_tree({})["segment"]})),
        lambda path: read_parameters(path, "segment", SegmentParameters),
    ),
    **dict.fromkeys(
        ("stages/tasks/own.yaml", "stages/tasks/params.yaml"),
        (_tasks, lambda path: read_task("reach", path.parent)),
    ),
    **dict.fromkeys(
        ("touches.csv", "touches.parquet"), (_touches, lambda path: read_touch_table(path, None))
    ),
    "measurements_1.npz": (_archive, lambda path: kuka_lwr4.read_motion(path.parent)),
    **dict.fromkeys(
        ("lerobot/meta/info.json", "lerobot/data/chunk-000/file-000.parquet"), (_episodes, _demonstrated)
    ),
    "robot.urdf": (
        lambda path: shutil.copy(Path(pybullet_data.getDataPath(), "kuka_iiwa/model.urdf"), path),
        lambda path: read_urdf(path).inertias,
    ),
}
SPECIMENS = {name: Specimen(name, *both, signed=True) for name, both in SIGNED.items()}
SPECIMENS |= {name: Specimen(name, *both, signed=False) for name, both in UNSIGNED.items()}
SPECIMENS["forged.safetensors"] = Specimen(
    "forged.safetensors", forged_skills.write, forged_skills.run, False, forged_skills.forged
)
