"""Recordings of a task for rerun."""

from structlearn.core.artefacts import publish
from structlearn.tasks.kinds import module_of
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task
from structlearn.viewer.recording import write


def main(files: TaskFiles) -> None:
    view = module_of(files.kind, "view")
    recordings = {} if files.absent else view.recordings(files)
    with publish(files.report / "rerun") as folder:
        folder.mkdir()
        for name, recording in recordings.items():
            write(folder / f"{name}.rrd", recording)
        if not recordings:
            leave_out(folder, files.absent or view.NOTHING)


if __name__ == "__main__":
    run_for_task(main)
