"""Recordings of a task for rerun."""

from structlearn.core.artefacts import publish
from structlearn.tasks.kinds import module_of
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    view = module_of(files.kind, "view")
    with publish(files.report / "rerun") as folder:
        folder.mkdir()
        if not files.absent:
            view.write(files, folder)
        if not any(folder.iterdir()):
            leave_out(folder, files.absent or view.NOTHING)


if __name__ == "__main__":
    run_for_task(main)
