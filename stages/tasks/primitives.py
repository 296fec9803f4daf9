"""Learn the primitives of a task, and unroll them as a sequence (dissertation IV.3, IV.5.4)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.primitives import sequence
from structlearn.primitives.fitting import FitParameters, cross_validation, learn_sequence
from structlearn.primitives.primitive_files import write_primitives
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    parameters = files.part("fit", FitParameters)
    situation = files.part("generalise", sequence.GeneraliseParameters)
    demonstrations, segmentation = files.runs("demonstrations"), files.segmentation()
    primitives = learn_sequence(demonstrations, segmentation.results, parameters)
    dt = demonstrations[0].dt
    paths = {
        "nominal": sequence.unroll(primitives, dt),
        "generalised": sequence.generalised(primitives, dt, situation),
    }
    with publish(files.folder / "primitives") as folder:
        folder.mkdir()
        write_primitives(primitives, folder / "primitives.safetensors")
        for name, path in paths.items():
            write_table(sequence.sequence_table(path, segmentation.primitives), folder / f"{name}.parquet")
        errors = cross_validation(demonstrations, segmentation.results, parameters)
        write_table(errors, folder / "reproduction.parquet")


if __name__ == "__main__":
    run_for_task(main, out="primitives")
