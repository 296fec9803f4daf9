"""Learn orientation primitives from recorded unscrewing, nearly a full turn (dissertation IV.3)."""

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import or_empty, run, stage_parameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.primitive_files import write_primitives
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.files import RecordedFiles
from structlearn.testbeds.recorded.protocol.movement import learn_unscrewing


def main() -> None:
    parameters = stage_parameters("recorded_unscrewing", FitParameters, PARAMETER_FILE)
    primitive, errors = learn_unscrewing(RecordedFiles().runs("unscrewing"), parameters)
    with publish("data/recorded/unscrewing") as folder:
        folder.mkdir()
        write_primitives([primitive], folder / "primitive.safetensors")
        write_table(errors, folder / "errors.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/unscrewing"))
