"""Write a task's recordings: movements and primitives, an arm with a load, touches, or reaches."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.primitives.primitive_files import read_vector_primitive
from structlearn.readers.demonstration import read_streams
from structlearn.tasks.motion.motion_parameters import MotionParameters, read_logs
from structlearn.tasks.motion.motion_view import write_carried
from structlearn.tasks.movement.movement_view import write_movements
from structlearn.tasks.obstacles.reaches_view import write_reaches_past_obstacles
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task
from structlearn.tasks.touch.surface_traces import on_one_clock
from structlearn.tasks.touch.touch_parameters import TouchParameters
from structlearn.tasks.touch.touch_view import write_skin, write_slides


def write_motion(files: TaskFiles, folder: Path) -> None:
    load = files.entry(MotionParameters).load
    if load is None or not (files.folder / "motion/carried.parquet").exists():
        return
    tables = {name: files.table(f"motion/{name}") for name in ("carried", "motions", "loads")}
    if len(tables["carried"]):
        logs = read_logs(files.recorded / "logs.parquet", files.entry(MotionParameters))
        write_carried(folder / "load.rrd", files.folder / "motion/identified.urdf", tables, logs, load)


def write_touch(files: TaskFiles, folder: Path) -> None:
    parameters, touch = files.entry(TouchParameters), files.folder / "touch"
    if parameters.surfaces is not None:
        trials = on_one_clock(read_streams(files.recorded / "streams.parquet"), parameters.surfaces)
        expected = read_vector_primitive(touch / "expected.safetensors")
        write_slides(folder / "slides.rrd", trials, expected, parameters.surfaces)
    elif parameters.transfer is None:
        write_skin(folder / "skin.rrd", files.tables("touch"), parameters.tuned_on)


def write_obstacles(files: TaskFiles, folder: Path) -> None:
    if (files.folder / "obstacles/paths.parquet").exists():
        tables = {name: files.table(f"obstacles/{name}") for name in ("paths", "shapes")}
        if len(tables["paths"]):
            title = f"{files.name}: reaches past obstacles"
            write_reaches_past_obstacles(folder / "obstacles.rrd", tables, title)


VIEWS = {
    "movement": (write_movements, ""),
    "motion": (write_motion, "The task has no load."),
    "touch": (write_touch, "Sets of touches have no recording; each is in its own task."),
    "obstacles": (write_obstacles, "The task has no reaches past obstacles."),
}
"""By kind of data: function that writes recordings to a folder, and the reason if it writes none."""


def main(files: TaskFiles) -> None:
    write, nothing = VIEWS[files.kind]
    with publish(files.report / "rerun") as folder:
        folder.mkdir()
        if not files.absent:
            write(files, folder)
        if not any(folder.iterdir()):
            leave_out(folder, files.absent or nothing)


if __name__ == "__main__":
    run_for_task(main)
