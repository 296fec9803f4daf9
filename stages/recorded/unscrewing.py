"""Learn orientation primitives from recorded unscrewing, nearly a full turn (dissertation IV.3)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.primitive_files import write_primitives
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.movement import learn_unscrewing
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_unscrewing", FitParameters, PARAMETER_FILE)
    primitive, errors = learn_unscrewing(RecordedFiles().runs("unscrewing"), parameters)
    with publish("data/recorded/unscrewing") as folder:
        folder.mkdir()
        write_primitives([primitive], folder / "primitive.safetensors")
        write_table(errors, folder / "errors.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/unscrewing"))
