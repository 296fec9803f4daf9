"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE, public_files
from structlearn.tasks.public.views.boxes_recording import write_box_reaches
from structlearn.tasks.public.views.ur10e_recording import write_carried


def show_boxes(stored: public_files.RecordedFiles, folder: Path) -> None:
    tables = stored.of_set("boxes")
    if len(tables["paths"]):
        write_box_reaches(folder / "boxes.rrd", tables)


def show_ur10e(stored: public_files.RecordedFiles, folder: Path) -> None:
    own, tables = stage_parameters("recorded_ur10e", MotionParameters, PARAMETER_FILE), stored.of_set("ur10e")
    if own.load is not None and len(tables["carried"]):
        write_carried(folder / "ur10e.rrd", stored.ur10e_urdf, tables, stored.ur10e_log, own.load)


SHOWN = {
    public_files.BOXES: show_boxes,
    public_files.UR10E: show_ur10e,
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
