"""Recording of a task's reaches past obstacles to look at: recorded hands, and those of models."""

from structlearn.core.artefacts import publish
from structlearn.tasks.obstacles.reaches_view import write_reaches_past_obstacles
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    with publish(files.report / "rerun") as folder:
        if not (files.folder / "obstacles/paths.parquet").exists():
            leave_out(folder, files.absent or "The task has no reaches past obstacles.")
            return
        folder.mkdir()
        tables = {name: files.table(f"obstacles/{name}") for name in ("paths", "shapes")}
        if len(tables["paths"]):
            title = f"{files.name}: reaches past obstacles"
            write_reaches_past_obstacles(folder / "obstacles.rrd", tables, title)


if __name__ == "__main__":
    run_for_task(main)
