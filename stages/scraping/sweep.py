"""Cut errors over noise, thresholds and down-sampling of the alignment (dissertation IV.5, appendix C)."""

from dissertation.scraping.protocol.cut_sweep import (
    SweepParameters,
    downsampling_effect,
    downsampling_sweep,
    noise_sweep,
    threshold_sweep,
)
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import read_runs
from structlearn.segmentation.parameters import SegmentParameters


def main() -> None:
    parameters = stage_parameters("segment_sweep", SweepParameters)
    segmentation = stage_parameters("segment", SegmentParameters)
    simulation = stage_parameters("simulate", DemonstratorParameters)
    demonstrations = read_runs("data/runs/scraping/nominal.parquet")
    effect = downsampling_effect(demonstrations, segmentation, parameters.downsampling)
    noise = noise_sweep(parameters, simulation, segmentation)
    thresholds = threshold_sweep(parameters, simulation, segmentation)
    people = downsampling_sweep(parameters, simulation, segmentation)
    with publish("data/segments/scraping_sweep") as folder:
        folder.mkdir()
        write_table(noise, folder / "noise.parquet")
        write_table(thresholds, folder / "thresholds.parquet")
        write_table(effect, folder / "downsampling.parquet")
        write_table(people, folder / "downsampling_people.parquet")


if __name__ == "__main__":
    run(main)
