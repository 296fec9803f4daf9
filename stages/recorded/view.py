"""Recordings of the recorded data to look at: what was recorded, what was learned from it, deviations."""

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.testbeds.recorded import files
from structlearn.testbeds.recorded.protocol.skin_parameters import SkinParameters
from structlearn.testbeds.recorded.protocol.slides import SlideParameters
from structlearn.testbeds.recorded.recordings import movement_recordings as movements
from structlearn.testbeds.recorded.recordings.skin_recording import write_skin
from structlearn.testbeds.recorded.recordings.unscrewing_recording import write_unscrewing


def main() -> None:
    slides = stage_parameters("recorded_slides", SlideParameters)
    skin = stage_parameters("recorded_skin", SkinParameters)
    turn_fit = stage_parameters("recorded_unscrewing", FitParameters)
    stored = files.RecordedFiles()
    reach = stored.primitives(files.REACHES)
    higher = stored.demonstrations(files.HIGHER_REACHES)
    logs = stored.demonstrations(files.UNSCREWING)
    turns = [turn for _, turn in segment_paths(logs, whole(logs), turn_fit.smoothing_hz)]
    execution, sequence = stored.demonstrations(files.SCRAPING), stored.primitives(files.SCRAPING)
    clock = {"rate_hz": slides.rate_hz, "max_gap_s": slides.max_gap_s}
    trials = stored.demonstrations(files.SLIDES, **clock)
    with publish("reports/recordings/recorded") as folder:
        folder.mkdir()
        movements.write_reaches(folder / "reaches.rrd", stored.demonstrations(files.REACHES), reach)
        movements.write_higher_reaches(
            folder / "corrected_reaches.rrd", higher, reach, stored.coupling_networks()
        )
        write_unscrewing(folder / "unscrewing.rrd", turns, stored.primitives(files.UNSCREWING)[0])
        movements.write_execution(folder / "scraping_recorded.rrd", execution)
        movements.write_sequence(folder / "scraping_learned.rrd", execution, sequence, stored.sequence())
        write_skin(folder / "skin.rrd", stored.skin(), skin.tuned_on)
        movements.write_slides(folder / "slides.rrd", trials, stored.expected_slide(), slides)


if __name__ == "__main__":
    run(main)
