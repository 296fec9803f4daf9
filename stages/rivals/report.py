"""Page on rivals, from their studies: run by hand after `make studies`."""

from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import RESULTS, Study, stored_study
from dissertation.evidence.study_cells import read_descriptions
from dissertation.evidence.study_tables import moved_parameters
from dissertation.rivals.choice import TrialParameters
from dissertation.rivals.page import findings
from dissertation.rivals.page.rivals_page import Compared, page
from dissertation.rivals.protocol import ComparisonParameters
from dissertation.rivals.reaching.reaching_protocol import ReachingParameters, ReachingTrialParameters
from structlearn.core.errors import InputError
from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.prose import listing


def main() -> None:
    board = Compared(
        study_as_now(findings.STUDY),
        study_as_now(findings.CHOICES),
        stage_parameters("rivals", ComparisonParameters),
        stage_parameters("rival_trials", TrialParameters),
        findings.LOOKS,
    )
    spheres = Compared(
        study_as_now(findings.REACHING),
        study_as_now(findings.REACHING_CHOICES),
        stage_parameters("reaching", ReachingParameters),
        stage_parameters("reaching_trials", ReachingTrialParameters),
        findings.AVOIDING,
    )
    document, drawn, tables, find = page(board, study_as_now(findings.LONGER), spheres)
    publish_judged("reports/rivals", {"index": document}, drawn, tables, find)


def study_as_now(name: str) -> Study:
    """A study. Raises InputError: it was not run, or with other parameters than those of `params.yaml`."""
    study = stored_study(RESULTS / name)
    if moved := moved_parameters(name, read_descriptions()[name], study):
        raise InputError(f"{name} was made with other {listing(moved)}: make studies NAME={name}")
    return study


if __name__ == "__main__":
    run(main)
