"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.readers import synchronise
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE, public_files
from structlearn.tasks.public.protocol.corrections import complete
from structlearn.tasks.public.protocol.slides import SlideParameters
from structlearn.tasks.public.views import movement_recordings as movements
from structlearn.tasks.public.views.movement_recordings import write_unscrewing
from structlearn.tasks.public.views.skin_recording import write_skin
from structlearn.tasks.public.views.ur10e_recording import write_carried
from structlearn.tasks.touch.touch_parameters import TouchParameters


def show_reaches(stored: public_files.RecordedFiles, folder: Path) -> None:
    reaches, primitive = stored.runs(public_files.REACHES), stored.primitives(public_files.REACHES)
    movements.write_reaches(folder / "reaches.rrd", reaches, primitive)


def show_higher_reaches(stored: public_files.RecordedFiles, folder: Path) -> None:
    higher = complete(stored.runs(public_files.HIGHER_REACHES), stored.completeness())
    learned = stored.primitives(public_files.REACHES), stored.coupling_networks()
    movements.write_higher_reaches(folder / "corrected_reaches.rrd", higher, *learned)


def show_unscrewing(stored: public_files.RecordedFiles, folder: Path) -> None:
    fit = stage_parameters("recorded_unscrewing", FitParameters, PARAMETER_FILE)
    logs = stored.runs(public_files.UNSCREWING)
    turns = [turn for _, turn in segment_paths(logs, whole(logs), fit.smoothing_hz)]
    write_unscrewing(folder / "unscrewing.rrd", turns, stored.primitives(public_files.UNSCREWING)[0])


def show_scraping(stored: public_files.RecordedFiles, folder: Path) -> None:
    execution, sequence = stored.runs(public_files.SCRAPING), stored.primitives(public_files.SCRAPING)
    movements.write_execution(folder / "scraping_recorded.rrd", execution)
    movements.write_sequence(folder / "scraping_learned.rrd", execution, sequence, stored.sequence())


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
    public_files.REACHES: show_reaches,
    public_files.HIGHER_REACHES: show_higher_reaches,
    public_files.UNSCREWING: show_unscrewing,
    public_files.SCRAPING: show_scraping,
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
