"""Expected sensor traces of recorded slides over one material, deviations on another (dissertation IV.6)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.primitives.primitive_files import write_vector_primitive
from structlearn.readers import synchronise
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.slides import (
    SlideParameters,
    across_materials,
    clock_errors,
    learn_slides,
    leave_one_out,
)
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_slides", SlideParameters, PARAMETER_FILE)
    recordings = RecordedFiles().streams("slides")
    demonstrations = [
        synchronise(recording, parameters.rate_hz, parameters.max_gap_s) for recording in recordings
    ]
    left_one_out, channels = leave_one_out(demonstrations, parameters)
    expected, deviations, statistics = learn_slides(demonstrations, parameters)
    with publish("data/recorded/slides") as folder:
        folder.mkdir()
        write_vector_primitive(expected, folder / "expected.safetensors", "electrode counts without offset")
        write_table(clock_errors(recordings), folder / "clock_errors.parquet")
        write_table(deviations, folder / "deviations.parquet")
        write_table(left_one_out, folder / "left_one_out.parquet")
        write_table(channels, folder / "channels.parquet")
        write_table(across_materials(demonstrations, parameters), folder / "across_materials.parquet")
        write_table(statistics, folder / "statistics.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/slides"))
