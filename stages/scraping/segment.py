"""Cut the nominal demonstrations into primitives (dissertation IV.5, IV.9.2)."""

from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.recordings.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut, write_segmentation


def main() -> None:
    parameters = stage_parameters("segment", SegmentParameters)
    clock = stage_parameters("clock", ClockParameters)
    demonstrations = read_demonstrations("data/raw/scraping/nominal", **clock.model_dump())
    write_segmentation(cut(demonstrations, parameters), "data/segments/scraping")


if __name__ == "__main__":
    run(main)
