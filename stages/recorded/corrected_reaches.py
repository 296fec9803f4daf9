"""Coupling targets of the higher reaches, learned over phase and added to the nominal primitive (IV.6)."""

from structlearn.feedback.pmnn import write_networks
from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.recordings import read_demonstrations
from structlearn.testbeds.recorded.protocol.corrected_reaches import complete, corrected_reaches
from structlearn.testbeds.recorded.protocol.correction_splits import CorrectionParameters, learn_corrections


def main() -> None:
    parameters = stage_parameters("recorded_corrections", CorrectionParameters)
    nominal = read_primitives("data/recorded/reaches/primitive.safetensors")[0].position
    demonstrations = complete(read_demonstrations("data/raw/recorded/corrected_reaches"))
    reaches = corrected_reaches(demonstrations, nominal, parameters.smoothing_hz)
    networks, results = learn_corrections(reaches, nominal.local, parameters)
    with publish("data/recorded/corrected_reaches") as folder:
        folder.mkdir()
        write_networks(networks, folder / "networks.safetensors")
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
