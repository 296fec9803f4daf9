"""Learn the primitives and the 38 electrode traces of a recorded scraping execution (dissertation IV.9)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.primitives.sequence import sequence_table
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.movement import (
    ExecutionParameters,
    learn_execution,
    learn_traces,
)
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_scraping", ExecutionParameters, PARAMETER_FILE)
    parts = RecordedFiles().runs("scraping")
    primitives, path, errors = learn_execution(parts, parameters.fit)
    sensors, scores, traces = learn_traces(parts, parameters)
    with publish("data/recorded/scraping") as folder:
        folder.mkdir()
        write_primitives(primitives, folder / "primitives.safetensors")
        write_table(sequence_table(path, [part.name for part in parts]), folder / "sequence.parquet")
        write_table(errors, folder / "errors.parquet")
        for part, sensor in zip(parts, sensors, strict=True):
            write_vector_primitive(
                sensor, folder / f"electrodes_{part.name}.safetensors", "electrode counts without offset"
            )
        write_table(scores, folder / "electrode_scores.parquet")
        write_table(traces, folder / "electrode_traces.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/scraping"))
