"""Page on rivals, from their studies: run by hand after `make studies`."""

from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import RESULTS, stored_study
from dissertation.rivals.choice import TrialParameters
from dissertation.rivals.page import findings
from dissertation.rivals.page.rivals_page import Compared, page
from dissertation.rivals.protocol import ComparisonParameters
from dissertation.rivals.reaching.reaching_protocol import ReachingParameters, ReachingTrialParameters
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    board = Compared(
        stored_study(RESULTS / findings.STUDY),
        stored_study(RESULTS / findings.CHOICES),
        stage_parameters("rivals", ComparisonParameters),
        stage_parameters("rival_trials", TrialParameters),
    )
    spheres = Compared(
        stored_study(RESULTS / findings.REACHING),
        stored_study(RESULTS / findings.REACHING_CHOICES),
        stage_parameters("reaching", ReachingParameters),
        stage_parameters("reaching_trials", ReachingTrialParameters),
    )
    longer = stored_study(RESULTS / findings.LONGER)
    document, drawn, tables, find = page(board, longer, spheres)
    publish_judged("reports/rivals", {"index": document}, drawn, tables, find)


if __name__ == "__main__":
    run(main)
