"""Learn orientation primitives from recorded unscrewing, nearly a full turn (dissertation IV.3)."""

from structlearn.artefacts import publish, write_table
from structlearn.primitives.storage import write_primitives
from structlearn.recorded.unscrewing import learn_unscrewing
from structlearn.recordings import read_demonstrations
from structlearn.segmentation.learning import FitParameters
from structlearn.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("recorded_unscrewing", FitParameters)
    primitive, errors = learn_unscrewing(read_demonstrations("data/raw/recorded/unscrewing"), parameters)
    with publish("data/recorded/unscrewing") as folder:
        folder.mkdir()
        write_primitives([primitive], folder / "primitive.safetensors")
        write_table(errors, folder / "errors.parquet")


if __name__ == "__main__":
    run(main)
