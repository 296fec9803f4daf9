"""Learn from a task's recordings, as its kind of data says."""

from structlearn.core.artefacts import publish
from structlearn.tasks.kinds import module_of
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task


def main(files: TaskFiles) -> None:
    with publish(files.learned) as folder:
        folder.mkdir()
        if files.absent:
            leave_out(folder, files.absent)
        else:
            module_of(files.kind, "learning").learn(files, folder)


if __name__ == "__main__":
    run_for_task(main)
