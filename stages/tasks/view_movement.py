"""Recordings of a task to look at: demonstrations with their cuts, and the primitives learned from them."""

from structlearn.core.artefacts import publish
from structlearn.tasks.movement.movement_view import write_movements
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    with publish(files.report / "rerun") as folder:
        if files.absent:
            leave_out(folder, files.absent)
        else:
            folder.mkdir()
            write_movements(files, folder)


if __name__ == "__main__":
    run_for_task(main)
