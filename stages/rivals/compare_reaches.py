"""Compare our avoidance with policies without structure on the same reaches of one person."""

from dissertation.evidence.results import FOLDER
from dissertation.rivals.reaching.reaching_protocol import (
    ReachingMethodParameters,
    ReachingParameters,
    compare_reaches,
    demonstrated_person,
)
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("reaching", ReachingParameters)
    methods = stage_parameters("reaching_methods", ReachingMethodParameters)
    person = demonstrated_person(tuning=False)
    with publish(FOLDER / "rivals.parquet") as path:
        write_table(compare_reaches(*person, parameters, methods), path)


if __name__ == "__main__":
    run(main)
