"""The report on recorded data: figures, tables, metrics and the page that shows them."""

from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.recorded import files
from structlearn.testbeds.recorded.page.assembly import HEADLINES, recorded_document
from structlearn.testbeds.recorded.page.figures import pictures
from structlearn.testbeds.recorded.page.results import RecordedResults, metrics
from structlearn.testbeds.recorded.page.tables import tables
from structlearn.testbeds.recorded.page.ur10e_figures import ur10e_pictures
from structlearn.testbeds.recorded.page.ur10e_page import ur10e_document, ur10e_tables
from structlearn.testbeds.recorded.page.ur10e_results import Ur10eResults
from structlearn.testbeds.recorded.page.ur10e_results import metrics as ur10e_metrics
from structlearn.testbeds.recorded.protocol.avoidance_parameters import RecordedAvoidanceParameters
from structlearn.testbeds.recorded.protocol.correction_splits import CorrectionParameters
from structlearn.testbeds.recorded.protocol.human_reaches import ReachParameters
from structlearn.testbeds.recorded.protocol.latent_touch_parameters import LatentTouchParameters
from structlearn.testbeds.recorded.protocol.panda_parameters import RecordedDynamicsParameters
from structlearn.testbeds.recorded.protocol.scraping_execution import ExecutionParameters
from structlearn.testbeds.recorded.protocol.slides import SlideParameters
from structlearn.testbeds.recorded.protocol.ur10e_parameters import RecordedUr10eParameters

PARAMETERS = {
    "recorded_reaches": ReachParameters,
    "recorded_corrections": CorrectionParameters,
    "recorded_unscrewing": FitParameters,
    "recorded_scraping": ExecutionParameters,
    "recorded_slides": SlideParameters,
    "recorded_avoidance": RecordedAvoidanceParameters,
    "recorded_latent_touch": LatentTouchParameters,
    "recorded_dynamics": RecordedDynamicsParameters,
}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    stored = files.RecordedFiles()
    reaches, logs = stored.demonstrations(files.REACHES), stored.demonstrations(files.UNSCREWING)
    fit, turn_fit = parameters["recorded_reaches"].fit, parameters["recorded_unscrewing"]
    results = RecordedResults(
        tables=stored.tables(),
        reach_segments=segment_paths(reaches, whole(reaches), fit.smoothing_hz),
        reach_primitive=stored.primitives(files.REACHES)[0],
        unscrewing_segments=segment_paths(logs, whole(logs), turn_fit.smoothing_hz),
        unscrewing_primitive=stored.primitives(files.UNSCREWING)[0],
        execution=stored.demonstrations(files.SCRAPING),
    )
    own = {"recorded_ur10e": stage_parameters("recorded_ur10e", RecordedUr10eParameters)}
    found = stored.ur10e()
    arm = Ur10eResults(found, own["recorded_ur10e"]) if found is not None else None
    shown = tables(results) | ur10e_tables(arm)
    pages = {
        "index": recorded_document(results, shown, parameters),
        "ur10e": ur10e_document(arm, shown, own),
    }
    drawn, numbers = pictures(results), metrics(results)
    if arm is not None:
        drawn, numbers = drawn | ur10e_pictures(arm), numbers | ur10e_metrics(arm)
    publish_report("reports/recorded", pages, drawn, shown, numbers, HEADLINES)


if __name__ == "__main__":
    run(main)
