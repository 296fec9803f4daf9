"""Try forms of every method on one person, for `rival_methods` in params.yaml."""

from dissertation.evidence.results import FOLDER
from dissertation.rivals.choice import TrialParameters, choose
from dissertation.rivals.imitation_data import recorded_person
from dissertation.rivals.protocol import ComparisonParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    trials = stage_parameters("rival_trials", TrialParameters)
    person = recorded_person(parameters.demonstrations)
    with publish(FOLDER / "rivals.parquet") as path:
        write_table(choose(*person, trials, parameters.seed), path)


if __name__ == "__main__":
    run(main)
