"""Try forms of every method past spheres on one person, for `reaching_methods` in params.yaml."""

from dissertation.evidence.results import FOLDER
from dissertation.rivals.reaching.reaching_protocol import (
    ReachingParameters,
    ReachingTrialParameters,
    demonstrated_person,
    try_reaches,
)
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("reaching", ReachingParameters)
    trials = stage_parameters("reaching_trials", ReachingTrialParameters)
    person = demonstrated_person(tuning=True)
    with publish(FOLDER / "rivals.parquet") as path:
        write_table(try_reaches(*person, parameters, trials), path)


if __name__ == "__main__":
    run(main)
