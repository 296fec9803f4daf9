"""The report of the scraping testbed: figures, tables, metrics and the page that shows them."""

from structlearn.feedback.feedback_models import FeedbackParameters
from structlearn.feedback.supervised_training import TrainingParameters
from structlearn.feedback.supervision import ExpectedTracesParameters, SupervisionParameters
from structlearn.ground.artefacts import read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.policy_search.sample_efficiency import ComparisonParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import GeneraliseParameters
from structlearn.recordings import read_demonstrations
from structlearn.recordings.source import ClockParameters, CorrectionSourceParameters, SourceParameters
from structlearn.reporting.page import Link
from structlearn.reporting.publishing import publish_report
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.result import read_segmentation
from structlearn.testbeds.scraping.page.feedback_files import read_feedback
from structlearn.testbeds.scraping.page.scraping_page import pictures, scraping_page
from structlearn.testbeds.scraping.page.scraping_results import ScrapingResults, metrics, tables
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.cut_sweep import SweepParameters
from structlearn.testbeds.scraping.protocol.executed_sets import EvaluationParameters
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

PARAMETERS = {
    "clock": ClockParameters,
    "record": SourceParameters,
    "simulate": DemonstratorParameters,
    "segment": SegmentParameters,
    "segment_sweep": SweepParameters,
    "fit_primitives": FitParameters,
    "generalise": GeneraliseParameters,
}
FEEDBACK_PARAMETERS = {
    "testbed": TestbedParameters,
    "expected_traces": ExpectedTracesParameters,
    "record_corrections": CorrectionSourceParameters,
    "coupling_dataset": SupervisionParameters,
    "train_feedback": FeedbackParameters,
    "compare_models": TrainingParameters,
    "evaluate_feedback": EvaluationParameters,
    "refine": BoardRefinementParameters,
    "evaluate_refinement": EvaluationParameters,
    "compare_search": ComparisonParameters,
}
RECORDINGS = {
    "demonstrations": "all demonstrations with their cut points",
    "alignment": "reference and guesses with their corresponding samples",
    "primitives": "the learned primitives and both sequences",
}
EXECUTED = {
    "feedback": "nominal, corrected and closed-loop runs at every tilt, with what the fingers feel",
    "robot": "the whole robot with feedback at the largest tilt",
}
REFINED = {"refinement": "runs before and after refinement by trial, with what the fingers feel"}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")
    of_feedback = {key: stage_parameters(key, model) for key, model in FEEDBACK_PARAMETERS.items()}
    names = [primitive.name for primitive in primitives]
    feedback = read_feedback("data/raw/scraping", "data/feedback/scraping", names, parameters | of_feedback)
    if feedback is not None:
        parameters |= of_feedback
    notes = RECORDINGS | (EXECUTED if feedback is not None and feedback.board is not None else {})
    notes |= REFINED if feedback is not None and feedback.refinement is not None else {}
    links = [Link(f"../recordings/scraping/{name}.rrd", f"{name}.rrd", note) for name, note in notes.items()]
    results = ScrapingResults(
        demonstrations=read_demonstrations("data/raw/scraping/nominal", **parameters["clock"].model_dump()),
        segmentation=read_segmentation("data/segments/scraping"),
        noise=read_table("data/segments/scraping_sweep/noise.parquet"),
        downsampling=read_table("data/segments/scraping_sweep/downsampling.parquet"),
        primitives=primitives,
        reproduction=read_table("data/primitives/scraping/reproduction.parquet"),
        nominal=read_table("data/primitives/scraping/nominal.parquet"),
        generalised=read_table("data/primitives/scraping/generalised.parquet"),
        segment_parameters=parameters["segment"],
        fit_parameters=parameters["fit_primitives"],
        feedback=feedback,
    )
    publish_report(
        "reports/scraping",
        pictures(results),
        tables(results),
        metrics(results),
        lambda sizes: scraping_page(results, sizes, parameters, links),
    )


if __name__ == "__main__":
    run(main)
