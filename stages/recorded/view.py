"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import synchronise
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE, public_files
from structlearn.tasks.public.protocol.slides import SlideParameters
from structlearn.tasks.public.views import movement_recordings as movements
from structlearn.tasks.public.views.skin_recording import write_skin
from structlearn.tasks.public.views.ur10e_recording import write_carried
from structlearn.tasks.touch.touch_parameters import TouchParameters


def show_slides(stored: public_files.RecordedFiles, folder: Path) -> None:
    slides = stage_parameters("recorded_slides", SlideParameters, PARAMETER_FILE)
    trials = [
        synchronise(one, slides.rate_hz, slides.max_gap_s) for one in stored.streams(public_files.SLIDES)
    ]
    movements.write_slides(folder / "slides.rrd", trials, stored.expected_slide(), slides)


def show_skin(stored: public_files.RecordedFiles, folder: Path) -> None:
    skin = stage_parameters("recorded_skin", TouchParameters, PARAMETER_FILE)
    write_skin(folder / "skin.rrd", stored.of_set("skin"), skin.tuned_on)


def show_ur10e(stored: public_files.RecordedFiles, folder: Path) -> None:
    own, tables = stage_parameters("recorded_ur10e", MotionParameters, PARAMETER_FILE), stored.of_set("ur10e")
    if own.load is not None and len(tables["carried"]):
        write_carried(folder / "ur10e.rrd", stored.ur10e_urdf, tables, stored.ur10e_log, own.load)


SHOWN = {
    public_files.SLIDES: show_slides,
    public_files.SKIN: show_skin,
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
