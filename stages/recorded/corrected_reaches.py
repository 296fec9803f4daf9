"""Coupling targets of the higher reaches, learned over phase and added to the nominal primitive (IV.6)."""

from structlearn.core.artefacts import filled, publish, write_table
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.feedback.coupling_model import write_networks
from structlearn.primitives.primitive_files import read_primitives
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.corrections import (
    CorrectionParameters,
    complete,
    completeness,
    corrected_reaches,
    learn_corrections,
)
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("recorded_corrections", CorrectionParameters, PARAMETER_FILE)
    demonstrations = RecordedFiles().runs("corrected_reaches", at_least=2)
    nominal = read_primitives(filled("data/recorded/reaches") / "primitive.safetensors")[0].position
    ends = completeness(demonstrations, nominal, parameters.incomplete_m)
    reaches = corrected_reaches(complete(demonstrations, ends), nominal, parameters.smoothing_hz)
    networks, results = learn_corrections(reaches, nominal.local, parameters)
    with publish("data/recorded/corrected_reaches") as folder:
        folder.mkdir()
        write_table(ends, folder / "completeness.parquet")
        write_networks(networks, folder / "networks.safetensors")
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/corrected_reaches"))
