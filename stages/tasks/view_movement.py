"""Recordings of a task to look at: demonstrations with their cuts, and the primitives learned from them."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.tasks.task_files import TaskFiles, leave_out, run_for_task
from structlearn.viewer.learned_primitives import write_primitives
from structlearn.viewer.recorded_demonstrations import write_demonstrations

DEMONSTRATED = (
    "Coloured by the primitive that they were cut into, white outside; each has a tab with its signals."
)
LEARNED = """Thick: the primitives in turn, from and to the mean start and goals (nominal) and others
(generalised); faint: demonstrations."""


def main(files: TaskFiles) -> None:
    with publish(files.report / "rerun") as folder:
        if files.absent:
            leave_out(folder, files.absent)
        else:
            write_recordings(files, folder)


def write_recordings(files: TaskFiles, folder: Path) -> None:
    """Two files in a folder, which is made."""
    demonstrations = files.runs("demonstrations")
    paths = {name: files.table(f"primitives/{name}") for name in ("nominal", "generalised")}
    folder.mkdir()
    write_demonstrations(
        folder / "demonstrations.rrd",
        demonstrations,
        files.segmentation(),
        f"{files.name}: demonstrations",
        DEMONSTRATED,
    )
    write_primitives(
        folder / "primitives.rrd",
        demonstrations,
        files.primitives(),
        paths,
        f"{files.name}: primitives",
        LEARNED,
    )


if __name__ == "__main__":
    run_for_task(main)
