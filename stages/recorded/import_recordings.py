"""Bring the public recordings in: each is read, checked and put on one clock; what cannot be is named."""

from pathlib import Path

from structlearn.ground.artefacts import write_csv
from structlearn.ground.stage import run, stage_parameters
from structlearn.testbeds.recorded import PARAMETER_FILE
from structlearn.testbeds.recorded.files import LEFT_OUT
from structlearn.testbeds.recorded.protocol.public_sets import PublicSourceParameters, import_sets


def main() -> None:
    parameters = stage_parameters("import_recordings", PublicSourceParameters, PARAMETER_FILE)
    write_csv(import_sets(parameters, Path("data/raw/recorded")), LEFT_OUT)


if __name__ == "__main__":
    run(main)
