"""The report on recorded data: figures, tables, metrics and the page that shows them."""

from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.fitting import FitParameters, segment_paths, whole
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.recorded import files
from structlearn.testbeds.recorded.page.assembly import HEADLINES, recorded_document
from structlearn.testbeds.recorded.page.figures import pictures
from structlearn.testbeds.recorded.page.results import RecordedResults, metrics
from structlearn.testbeds.recorded.page.skin_figures import skin_pictures
from structlearn.testbeds.recorded.page.skin_results import (
    SkinResults,
    skin_document,
    skin_metrics,
    skin_tables,
)
from structlearn.testbeds.recorded.page.tables import tables
from structlearn.testbeds.recorded.protocol.avoidance_parameters import RecordedAvoidanceParameters
from structlearn.testbeds.recorded.protocol.correction_splits import CorrectionParameters
from structlearn.testbeds.recorded.protocol.human_reaches import ReachParameters
from structlearn.testbeds.recorded.protocol.latent_touch_parameters import LatentTouchParameters
from structlearn.testbeds.recorded.protocol.panda_parameters import RecordedDynamicsParameters
from structlearn.testbeds.recorded.protocol.scraping_execution import ExecutionParameters
from structlearn.testbeds.recorded.protocol.skin_parameters import SkinParameters
from structlearn.testbeds.recorded.protocol.slides import SlideParameters

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
    settings = {"recorded_skin": stage_parameters("recorded_skin", SkinParameters)}
    skin = SkinResults(stored.skin(), settings["recorded_skin"].tuned_on)
    shown, skin_shown = tables(results), skin_tables(skin)
    pages = {
        "index": recorded_document(results, shown, parameters),
        "skin": skin_document(skin, skin_shown, settings),
    }
    publish_report(
        "reports/recorded",
        pages,
        pictures(results) | skin_pictures(skin),
        shown | skin_shown,
        metrics(results) | skin_metrics(skin),
        HEADLINES,
    )


if __name__ == "__main__":
    run(main)
