"""Find recorded reaches between rests, and learn one position primitive from them (dissertation IV.5)."""

from structlearn.core.artefacts import publish, write_metrics, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.primitives.fitting import segment_paths, whole
from structlearn.primitives.primitive_files import write_primitives
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.movement import (
    ReachParameters,
    learn_reaches,
    own_spread_mm,
    reach_cut_errors,
)
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_reaches", ReachParameters, PARAMETER_FILE)
    demonstrations = RecordedFiles().runs("reaches", at_least=2)
    primitive, errors = learn_reaches(demonstrations, parameters)
    segments = segment_paths(demonstrations, whole(demonstrations), parameters.fit.smoothing_hz)
    with publish("data/recorded/reaches") as folder:
        folder.mkdir()
        write_primitives([primitive], folder / "primitive.safetensors")
        write_table(errors, folder / "reproduction.parquet")
        write_table(reach_cut_errors(demonstrations, parameters), folder / "cut_errors.parquet")
        write_metrics({"own_spread_mm": own_spread_mm(segments)}, folder / "spread.json")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/reaches"))
