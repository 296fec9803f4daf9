"""Recordings to look at: the demonstrations and their cuts, the alignment, the learned primitives (IV.5)."""

from structlearn.artefacts import publish, read_table
from structlearn.primitives.storage import read_primitives
from structlearn.recordings import read_demonstrations
from structlearn.recordings.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.result import read_segmentation
from structlearn.stage import run, stage_parameters
from structlearn.viewer import write_alignment, write_demonstrations, write_primitives

FOLDER = "reports/recordings/scraping"


def main() -> None:
    parameters = stage_parameters("segment", SegmentParameters)
    clock = stage_parameters("clock", ClockParameters)
    demonstrations = read_demonstrations("data/raw/scraping/nominal", **clock.model_dump())
    segmentation = read_segmentation("data/segments/scraping")
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    paths = {
        name: read_table(f"data/primitives/scraping/{name}.parquet") for name in ("nominal", "generalised")
    }

    with publish(f"{FOLDER}/demonstrations.rrd") as path:
        write_demonstrations(path, demonstrations, segmentation, "Scraping: demonstrations")
    with publish(f"{FOLDER}/alignment.rrd") as path:
        write_alignment(path, demonstrations, segmentation, parameters, "Scraping: alignment")
    with publish(f"{FOLDER}/primitives.rrd") as path:
        write_primitives(path, demonstrations, primitives, paths, "Scraping: primitives")


if __name__ == "__main__":
    run(main)
