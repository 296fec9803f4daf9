"""Bring the public recordings in: each is read, checked and put on one clock; what cannot be is named."""

from pathlib import Path

from structlearn.core.artefacts import write_csv
from structlearn.core.stage import run, stage_parameters
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.protocol.public_sets import PublicSourceParameters, import_sets
from structlearn.tasks.public.public_files import LEFT_OUT


def main() -> None:
    parameters = stage_parameters("import_recordings", PublicSourceParameters, PARAMETER_FILE)
    write_csv(import_sets(parameters, Path("data/raw/recorded")), LEFT_OUT)


if __name__ == "__main__":
    run(main)
