"""Recording of an arm carrying a load, and of the load's online estimate."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import BLUE, GREY, LIGHT_GREY, ORANGE
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
from structlearn.viewer.arm_meshes import (
    arm_contents,
    arm_view,
    followed_view,
    link_frame,
    send_followed,
    send_sticks,
)
from structlearn.viewer.rrd import legend, recording

ARM, BODY = "arm", "load"
RATE_HZ, RADIUS_M = 25.0, 0.06  # sampling rate of the motion; drawn radius of the load
REFERENCE, FOUND, EMPTY = LIGHT_GREY, BLUE, GREY

NOTHING = "The task has no load."


def write(files: TaskFiles, folder: Path) -> None:
    """Write the recording of the load, if the task has one."""
    parameters = files.entry(MotionParameters)
    if parameters.load is None or not (files.learned / "carried.parquet").exists():
        return
    tables = {name: files.table(f"motion/{name}") for name in ("carried", "motions", "loads")}
    if len(tables["carried"]):
        logs = read_task_logs(files.recorded / "logs.parquet", parameters)
        write_carried(folder / "load.rrd", files.learned / "identified.urdf", tables, logs, parameters.load)


def write_carried(
    path: str | Path,
    urdf: str | Path,
    tables: Mapping[str, pd.DataFrame],
    logs: Mapping[str, MotionLog],
    load: LoadParameters,
) -> None:
    """Record the first motion with the load, and what is learned of it online."""
    carried = tables["carried"]
    name = carried["log"].iloc[0]
    learned = carried[(carried["log"] == name) & (carried["stage"] == CARRYING)]
    cut = tables["motions"].set_index("log").loc[name]
    log = logs[name]
    time = np.arange(0.0, cut["end_s"] - cut["start_s"], 1.0 / RATE_HZ)
    q = np.stack([np.interp(time + cut["start_s"], log.time, column) for column in log.positions.T], axis=1)
    weighed = tables["loads"].set_index(["pair", "gains"]).loc[(name, "found")]
    centre = weighed[CENTRE].to_numpy(float)
    with recording(path, f"Arm with its load: {name}") as to:
        reach = send_sticks(to, ARM, urdf, log.joints, time, q, (LIGHT_GREY, GREY))
        to.show(_blueprint(reach))
        to.still(BODY, rr.CoordinateFrame(link_frame(ARM, moved_link(urdf, log.joints[-1]))))
        to.dots(BODY, centre[None], ORANGE, RADIUS_M)
        to.lines(f"{BODY}/held", [[np.zeros(3), centre]], ORANGE, 0.2 * RADIUS_M)
        followed = learned.assign(time_s=learned["since_s"])
        really = np.full(len(time), load.known_kg)
        send_followed(to, followed, time, really, (REFERENCE, FOUND, EMPTY))
        to.notes(_notes(load))


def _blueprint(reach: float) -> rrb.Container:
    around = reach * np.array([[0.4, 0, 0], [-0.4, 0, 0], [0, 0.4, 0], [0, 0, 1.0]])  # also when upright
    view = arm_view("Arm with its load", [arm_contents(ARM), f"/{BODY}"], around)
    return followed_view(view)


def _notes(load: LoadParameters) -> str:
    colours = {
        "the load at its centre by least squares, joined to the flange": ORANGE,
        f"its published mass, {load.known_kg:g} kg (wide)": REFERENCE,
        "online estimate of the last link (Cov), and its error": FOUND,
        "error of the model of the empty arm": EMPTY,
    }
    return (
        "### A recorded arm with a load at its flange\n\nThe arm was identified on a motion without the "
        "load; sticks join its joints. Samples older than "
        f"{load.memory_s:g} s have half the weight.\n\n{legend(colours)}\n\n"
        "First moment of the mass: x orange, y green, z blue.\n"
    )
