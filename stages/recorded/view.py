"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from pathlib import Path

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.recordings import synchronise
from structlearn.tasks.motion_parameters import MotionParameters
from structlearn.tasks.touch_parameters import TouchParameters
from structlearn.testbeds.recorded import PARAMETER_FILE, files
from structlearn.testbeds.recorded.protocol.corrections import complete
from structlearn.testbeds.recorded.protocol.slides import SlideParameters
from structlearn.testbeds.recorded.recordings import movement_recordings as movements
from structlearn.testbeds.recorded.recordings.boxes_recording import write_box_reaches
from structlearn.testbeds.recorded.recordings.movement_recordings import write_unscrewing
from structlearn.testbeds.recorded.recordings.skin_recording import write_skin
from structlearn.testbeds.recorded.recordings.ur10e_recording import write_carried


def show_reaches(stored: files.RecordedFiles, folder: Path) -> None:
    reaches, primitive = stored.runs(files.REACHES), stored.primitives(files.REACHES)
    movements.write_reaches(folder / "reaches.rrd", reaches, primitive)


def show_higher_reaches(stored: files.RecordedFiles, folder: Path) -> None:
    higher = complete(stored.runs(files.HIGHER_REACHES), stored.completeness())
    learned = stored.primitives(files.REACHES), stored.coupling_networks()
    movements.write_higher_reaches(folder / "corrected_reaches.rrd", higher, *learned)


def show_unscrewing(stored: files.RecordedFiles, folder: Path) -> None:
    fit = stage_parameters("recorded_unscrewing", FitParameters, PARAMETER_FILE)
    logs = stored.runs(files.UNSCREWING)
    turns = [turn for _, turn in segment_paths(logs, whole(logs), fit.smoothing_hz)]
    write_unscrewing(folder / "unscrewing.rrd", turns, stored.primitives(files.UNSCREWING)[0])


def show_scraping(stored: files.RecordedFiles, folder: Path) -> None:
    execution, sequence = stored.runs(files.SCRAPING), stored.primitives(files.SCRAPING)
    movements.write_execution(folder / "scraping_recorded.rrd", execution)
    movements.write_sequence(folder / "scraping_learned.rrd", execution, sequence, stored.sequence())


def show_slides(stored: files.RecordedFiles, folder: Path) -> None:
    slides = stage_parameters("recorded_slides", SlideParameters, PARAMETER_FILE)
    trials = [synchronise(one, slides.rate_hz, slides.max_gap_s) for one in stored.streams(files.SLIDES)]
    movements.write_slides(folder / "slides.rrd", trials, stored.expected_slide(), slides)


def show_boxes(stored: files.RecordedFiles, folder: Path) -> None:
    tables = stored.of_set("boxes")
    if len(tables["paths"]):
        write_box_reaches(folder / "boxes.rrd", tables)


def show_skin(stored: files.RecordedFiles, folder: Path) -> None:
    skin = stage_parameters("recorded_skin", TouchParameters, PARAMETER_FILE)
    write_skin(folder / "skin.rrd", stored.of_set("skin"), skin.tuned_on)


def show_ur10e(stored: files.RecordedFiles, folder: Path) -> None:
    own = stage_parameters("recorded_ur10e", MotionParameters, PARAMETER_FILE)
    tables = stored.of_set("ur10e")
    if own.load is not None and len(tables["carried"]):
        write_carried(folder / "ur10e.rrd", stored.ur10e_urdf, tables, stored.ur10e_log, own.load)


SHOWN = {
    files.REACHES: show_reaches,
    files.HIGHER_REACHES: show_higher_reaches,
    files.UNSCREWING: show_unscrewing,
    files.SCRAPING: show_scraping,
    files.SLIDES: show_slides,
    files.BOXES: show_boxes,
    files.SKIN: show_skin,
    files.UR10E: show_ur10e,
}
"""By set."""


def main() -> None:
    stored = files.RecordedFiles()
    with publish("reports/recordings/recorded") as folder:
        folder.mkdir()
        for name, show in SHOWN.items():
            if stored.shown(name):
                show(stored, folder)


if __name__ == "__main__":
    run(main)
