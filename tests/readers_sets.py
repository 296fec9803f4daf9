"""Tiny files in the layouts of public sets."""

import json

import numpy as np
import pandas as pd
from readers_bags import pose_rows

from dissertation.recorded.readers import eflesh

SKIN_START_S = 1_700_000_000.0
SHAPE = "object,x,y,z,width,height,depth\n"
BOXES = "Target,0,0.8,0.2,0.05,0.09,0.06\nFailOnTouchObstacleLong-1,0.1,0.79,-0.1,0.15,0.12,0.05\n"


def write_skin(folder, kind=eflesh.PRESSES, name="a", states=((0, 1, 2, 3), (4, 5, 6, 7)), sensed=(0.1, 3.9)):
    """A run with given states (rows of numbers after the time) and times of readings, counts 1, 2, ..."""
    path = folder / eflesh.FOLDERS[kind] / name
    path.mkdir(parents=True, exist_ok=True)
    lines = [",".join(f"{value:.6f}" for value in (SKIN_START_S + time, *rest)) for time, *rest in states]
    (path / "states.csv").write_text("\n".join(lines) + "\n")
    counts = ",".join(f"{channel}.0" for channel in range(1, 31 if kind == eflesh.SHEAR else 16))
    readings = "".join(f"{SKIN_START_S + time:.6f},{counts}\n" for time in sensed)
    (path / "sensor_post_baselines.csv").write_text(readings)


def write_kuka(folder, name="measurements_1", **changes):
    values = {name: np.arange(21.0).reshape(3, 7) for name in ("positions", "velocities", "torques")}
    values |= {"times": np.array([1.46e9, 1.46e9 + 0.005, 1.46e9 + 0.01])} | changes
    np.savez(folder / f"{name}.npz", **values)


def write_ur10e(folder, names=("ur-b", "ur-a")):
    """Logs of three rows, at uneven times: 0, 1, ... 29, then by 100 more per row."""
    for name in names:
        rows = [[time, *(100 * row + np.arange(30))] for row, time in enumerate((200.743, 200.755, 200.765))]
        (folder / f"{name}.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))


def write_boxes(folder):
    """Two trials, of which one is there."""
    rows = "sub_01,7,main,100.01,100.03\nsub_02,11,main,100.01,100.03\n"
    (folder / "trials.csv").write_text(f"participant,trial,type,start_moved_time,target_reached_time\n{rows}")
    trial = folder / "sub_01/T007"
    trial.mkdir(parents=True, exist_ok=True)
    hand = "".join(f"{100 + 0.01 * row:.4f},0.1,0.2,-0.3,0,90,0\n" for row in range(5))
    (trial / "HandTracker_movement_T007.csv").write_text("time,pos_x,pos_y,pos_z,rot_x,rot_y,rot_z\n" + hand)
    (trial / "grid_objects_layout_T007.csv").write_text(SHAPE + BOXES)
    scene = "TableTop,0,0.7,0,1,0.1,1\nLeftBoundary,-0.36,0.8,0,0.02,0.13,0.6\n"
    (trial / "scene_layout_T007.csv").write_text(SHAPE + scene)


def write_dataset(folder, frames=None, **changes):
    """A LeRobotDataset of three frames with one feature, `pose`; frames or description may be changed."""
    for inside in ("meta", "data/chunk-000"):
        (folder / inside).mkdir(parents=True, exist_ok=True)
    pose = {"pose": {"names": ["x", "y", "z"]}}
    info = {"codebase_version": "v3.0", "fps": 10, "total_episodes": 1, "features": pose} | changes
    (folder / "meta/info.json").write_text(json.dumps(info))
    table = {"episode_index": [0] * 3, "frame_index": range(3), "pose": list(pose_rows(3)[:, :3])}
    path = folder / "data/chunk-000/file-000.parquet"
    pd.DataFrame(table | (frames or {})).to_parquet(path, index=False)
