"""Compare our feedback with policies without structure on the same demonstrations of one person."""

from dissertation.evidence.results import FOLDER
from dissertation.rivals.imitation_data import recorded_person
from dissertation.rivals.protocol import ComparisonParameters, MethodParameters, compare
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    methods = stage_parameters("rival_methods", MethodParameters)
    person = recorded_person(parameters.demonstrations)
    with publish(FOLDER / "rivals.parquet") as path:
        write_table(compare(*person, parameters, methods), path)


if __name__ == "__main__":
    run(main)
