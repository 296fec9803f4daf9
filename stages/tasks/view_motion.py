"""Recording of an arm that carries a load, to look at."""

from structlearn.core.artefacts import publish
from structlearn.tasks.motion.motion_parameters import MotionParameters, read_logs
from structlearn.tasks.motion.motion_view import write_carried
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    parameters = files.entry(MotionParameters)
    with publish(files.report / "rerun") as folder:
        carried = files.folder / "motion/carried.parquet"
        if parameters.load is None or not carried.exists() or files.table("motion/carried").empty:
            leave_out(folder, files.absent or "The task has no load.")
        else:
            folder.mkdir()
            tables = {name: files.table(f"motion/{name}") for name in ("carried", "motions", "loads")}
            logs = read_logs(files.recorded / "logs.parquet", parameters)
            urdf = files.folder / "motion/identified.urdf"
            write_carried(folder / "load.rrd", urdf, tables, logs, parameters.load)


if __name__ == "__main__":
    run_for_task(main)
