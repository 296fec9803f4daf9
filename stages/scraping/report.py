"""Publish the report of the scraping testbed: its three pages, figures, tables and findings."""

from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.feedback.coupling_targets import ExpectedTracesParameters, SupervisionParameters
from structlearn.feedback.feedback_models import FeedbackParameters
from structlearn.policy_search.sample_efficiency import ComparisonParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.sequence import GeneraliseParameters
from structlearn.readers.source import ClockParameters
from structlearn.reporting.claims import quoted_claims
from structlearn.reporting.publishing import publish_report
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.testbeds.scraping.files import ScrapingFiles
from structlearn.testbeds.scraping.page.findings import findings
from structlearn.testbeds.scraping.page.page import drawings, pages, published
from structlearn.testbeds.scraping.page.stored import read_stored
from structlearn.testbeds.scraping.page.tables import derived, tables
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.cut_sweep import SweepParameters
from structlearn.testbeds.scraping.protocol.execution_scores import ExecutionParameters
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

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
        "train_feedback": FeedbackParameters,
        "compare_models": TrainingParameters,
        "evaluate_feedback": ExecutionParameters,
    },
    "refinement": {
        "refine": BoardRefinementParameters,
        "evaluate_refinement": ExecutionParameters,
        "compare_search": ComparisonParameters,
    },
}
"""Parameters behind the results, by page."""


def main() -> None:
    models = {key: model for page in PARAMETERS.values() for key, model in page.items()}
    parameters = {key: stage_parameters(key, model) for key, model in models.items()}
    stored, printed = read_stored(ScrapingFiles(), parameters), published()
    frames = derived(stored, printed)
    find, shown = findings(stored, frames), tables(frames)
    documents = pages(stored, frames, find, shown, printed, PARAMETERS)
    drawn = drawings(stored, frames)
    publish_report("reports/scraping", documents, drawn, shown, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
