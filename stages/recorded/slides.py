"""Expected sensor traces of recorded slides over one material, deviations on another (dissertation IV.6)."""

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.primitive_files import write_vector_primitive
from structlearn.recordings import read_recordings, synchronise
from structlearn.testbeds.recorded.protocol.slides import (
    SlideParameters,
    clock_errors,
    learn_slides,
    leave_one_out,
)


def main() -> None:
    parameters = stage_parameters("recorded_slides", SlideParameters)
    recordings = read_recordings("data/raw/recorded/slides")
    demonstrations = [
        synchronise(recording, parameters.rate_hz, parameters.max_gap_s) for recording in recordings
    ]
    expected, deviations, statistics = learn_slides(demonstrations, parameters)
    with publish("data/recorded/slides") as folder:
        folder.mkdir()
        write_vector_primitive(expected, folder / "expected.safetensors", "electrode counts without offset")
        write_table(clock_errors(recordings), folder / "clock_errors.parquet")
        write_table(deviations, folder / "deviations.parquet")
        write_table(leave_one_out(demonstrations, parameters), folder / "left_one_out.parquet")
        write_table(statistics, folder / "statistics.parquet")


if __name__ == "__main__":
    run(main)
