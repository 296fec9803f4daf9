"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run
from structlearn.tasks.public import public_files
from structlearn.tasks.public.views.boxes_recording import write_box_reaches


def show_boxes(stored: public_files.RecordedFiles, folder: Path) -> None:
    tables = stored.of_set("boxes")
    if len(tables["paths"]):
        write_box_reaches(folder / "boxes.rrd", tables)


SHOWN = {
    public_files.BOXES: show_boxes,
}
"""By set."""


def main() -> None:
    stored = public_files.RecordedFiles()
    with publish("reports/rerun/recorded") as folder:
        folder.mkdir()
        for name, show in SHOWN.items():
            if stored.shown(name):
                show(stored, folder)


if __name__ == "__main__":
    run(main)
