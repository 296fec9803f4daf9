"""Page on rivals, from their studies: run by hand after `make studies NAME=rivals/people`."""

from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import read_study
from dissertation.rivals.choice import TrialParameters
from dissertation.rivals.findings import STUDY
from dissertation.rivals.protocol import ComparisonParameters
from dissertation.rivals.rivals_page import page
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    budget = stage_parameters("rival_trials", TrialParameters)
    document, drawn, tables, find = page(read_study(STUDY), read_study("rivals/choice"), parameters, budget)
    publish_judged("reports/rivals", {"index": document}, drawn, tables, find)


if __name__ == "__main__":
    run(main)
