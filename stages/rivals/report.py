"""Page on rivals, from their studies: run by hand after `make studies NAME=rivals/people`."""

from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import RESULTS, stored_study
from dissertation.rivals.choice import TrialParameters
from dissertation.rivals.page.findings import CHOICES, STUDY
from dissertation.rivals.page.rivals_page import page
from dissertation.rivals.protocol import ComparisonParameters
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("rivals", ComparisonParameters)
    budget = stage_parameters("rival_trials", TrialParameters)
    studies = (stored_study(RESULTS / name) for name in (STUDY, CHOICES))
    document, drawn, tables, find = page(*studies, parameters, budget)
    publish_judged("reports/rivals", {"index": document}, drawn, tables, find)


if __name__ == "__main__":
    run(main)
