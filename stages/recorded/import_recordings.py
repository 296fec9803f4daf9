"""Bring the public recordings into the pipeline: text logs to MCAP, provenance kept."""

from structlearn.artefacts import publish
from structlearn.recordings import clmc, slide, write_recordings
from structlearn.recordings.source import PublicSourceParameters
from structlearn.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("import_recordings", PublicSourceParameters)
    folder = parameters.folder
    sets = {
        "reaches": clmc.read_reaches(folder / "clmc"),
        "corrected_reaches": clmc.read_reaches(folder / "clmc", "dataset2_part"),
        "unscrewing": clmc.read_unscrewing(folder / "clmc"),
        "scraping": clmc.read_scraping_execution(folder / "clmc"),
        "slides": slide.read_slides(folder / "slide", parameters.slide_trials),
    }
    for name, recordings in sets.items():
        with publish(f"data/raw/recorded/{name}") as target:
            write_recordings(recordings, target)


if __name__ == "__main__":
    run(main)
