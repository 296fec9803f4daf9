"""Report of the scraping testbed: three pages with figures, tables and findings."""

from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.results import read_results
from dissertation.evidence.studies import RESULTS, stored_study
from dissertation.scraping.files import ScrapingFiles
from dissertation.scraping.page.findings import STUDY, findings
from dissertation.scraping.page.page import beside, drawings, pages
from dissertation.scraping.page.stored import read_stored
from dissertation.scraping.page.tables import derived, tables
from dissertation.scraping.protocol.board_refinement import BoardRefinementParameters
from dissertation.scraping.protocol.cut_sweep import SweepParameters
from dissertation.scraping.protocol.execution_scores import ExecutionParameters
from dissertation.scraping.protocol.feedback_models import FinalModelParameters
from dissertation.scraping.protocol.sample_efficiency import ComparisonParameters
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_targets import ExpectedTracesParameters, SupervisionParameters
from structlearn.feedback.trainers import TrainingParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.sequence import GeneraliseParameters
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.parameters import SegmentParameters

PARAMETERS = {
    "index": {
        "clock": ClockParameters,
        "simulate": DemonstratorParameters,
        "segment": SegmentParameters,
        "segment_sweep": SweepParameters,
        "fit_primitives": FitParameters,
        "generalise": GeneraliseParameters,
    },
    "feedback": {
        "scraping_people": Population,
        "testbed": TestbedParameters,
        "expected_traces": ExpectedTracesParameters,
        "record_corrections": ExecutionParameters,
        "coupling_dataset": SupervisionParameters,
        "train_feedback": FinalModelParameters,
        "compare_models": TrainingParameters,
        "evaluate_feedback": ExecutionParameters,
    },
    "refinement": {
        "refine": BoardRefinementParameters,
        "evaluate_refinement": ExecutionParameters,
        "compare_search": ComparisonParameters,
    },
}
"""Parameters that the results of each page were made with."""


def main() -> None:
    models = {key: model for page in PARAMETERS.values() for key, model in page.items()}
    parameters = {key: stage_parameters(key, model) for key, model in models.items()}
    stored, own = read_stored(ScrapingFiles(), parameters), read_results("scraping")
    study = stored_study(RESULTS / STUDY) if (RESULTS / STUDY).exists() else None
    frames = derived(stored, beside("published"))
    find, shown = findings(own, study, parameters["segment_sweep"].people), tables(frames)
    documents = pages(stored, frames, find, shown, study, PARAMETERS)
    drawn = drawings(stored, frames, own, study)
    publish_judged("reports/scraping", documents, drawn, shown, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
