"""Recording of an arm carrying a load, and of the load's online estimate."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.palette import BLUE, GREY, LIGHT_GREY, PINK
from structlearn.readers.joint_log import MotionLog
from structlearn.rigid_body.urdf import moved_link
from structlearn.tasks.motion.parameters import (
    CARRYING,
    CENTRE,
    LoadParameters,
    MotionParameters,
    read_task_logs,
)
from structlearn.tasks.task_files import TaskFiles
from structlearn.viewer import items, views
from structlearn.viewer.arms import arm_scene, attached, followed, sticks
from structlearn.viewer.recording import Recording

ARM, BODY = "arm", "load"
RATE_HZ, RADIUS_M = 25.0, 0.06  # sampling rate of the motion; drawn radius of the load
REFERENCE, FOUND, EMPTY = LIGHT_GREY, BLUE, GREY

NOTHING = "The task has no load."


def recordings(files: TaskFiles) -> dict[str, Recording]:
    """The recording of the load, if the task has one."""
    parameters = files.entry(MotionParameters)
    if parameters.load is None or not (files.learned / "carried.parquet").exists():
        return {}
    tables = {name: files.table(f"motion/{name}") for name in ("carried", "motions", "loads")}
    if not len(tables["carried"]):
        return {}
    logs = read_task_logs(files.recorded / "logs.parquet", parameters)
    return {"load": carried(files.learned / "identified.urdf", tables, logs, parameters.load)}


def carried(
    urdf: str | Path, tables: Mapping[str, pd.DataFrame], logs: Mapping[str, MotionLog], load: LoadParameters
) -> Recording:
    """The first motion with the load, and what is learned of it online."""
    learned = tables["carried"]
    name = learned["log"].iloc[0]
    learned = learned[(learned["log"] == name) & (learned["stage"] == CARRYING)]
    cut, log = tables["motions"].set_index("log").loc[name], logs[name]
    time = np.arange(0.0, cut["end_s"] - cut["start_s"], 1.0 / RATE_HZ)
    q = np.stack([np.interp(time + cut["start_s"], log.time, column) for column in log.positions.T], axis=1)
    weighed = tables["loads"].set_index(["pair", "gains"]).loc[(name, "found")]
    centre, link = weighed[CENTRE].to_numpy(float), moved_link(urdf, log.joints[-1])
    arm, reach = sticks(ARM, urdf, log.joints, time, q, (LIGHT_GREY, GREY))
    ball = items.dots(BODY, centre[None], PINK, RADIUS_M)
    held = items.lines(f"{BODY}/held", [[np.zeros(3), centre]], PINK, 0.2 * RADIUS_M)
    around = reach * np.array([[0.4, 0, 0], [-0.4, 0, 0], [0, 0.4, 0], [0, 0, 1.0]])  # also when upright
    scene = arm_scene("Arm with its load", [*arm, attached(ball, ARM, link), held], around)
    colours = {
        "the load at its centre by least squares, joined to the flange": PINK,
        f"its published mass, {load.known_kg:g} kg (wide)": REFERENCE,
        "online estimate of the last link (Cov), and its error": FOUND,
        "error of the model of the empty arm": EMPTY,
    }
    notes = (
        "### A recorded arm with a load at its flange\n\nThe arm was identified on a motion without the "
        "load; sticks join its joints. Samples older than "
        f"{load.memory_s:g} s have half the weight.\n\n{views.legend(colours)}\n\n"
        "First moment of the mass: x orange, y green, z blue.\n"
    )
    truth = np.full(len(time), load.known_kg)
    online = learned.assign(time_s=learned["since_s"])
    content = followed(scene, online, time, truth, (REFERENCE, FOUND, EMPTY), notes)
    return Recording(f"Arm with its load: {name}", content)
