"""Cut the nominal demonstrations into primitives (dissertation IV.5, IV.9.2)."""

from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import read_runs
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut, write_segmentation


def main() -> None:
    parameters = stage_parameters("segment", SegmentParameters)
    demonstrations = read_runs("data/runs/scraping/nominal.parquet")
    write_segmentation(cut(demonstrations, parameters), "data/segments/scraping")


if __name__ == "__main__":
    run(main)
