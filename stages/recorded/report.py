"""The report on recorded data: figures, tables, metrics and the pages that show them."""

from structlearn.avoidance.scene_people import ScenePeopleParameters
from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.page.assembly import recorded_pictures, recorded_report
from structlearn.tasks.public.page.recorded_results import read_results
from structlearn.tasks.public.protocol.avoidance_representations import RecordedAvoidanceParameters
from structlearn.tasks.public.public_files import RecordedFiles

PARAMETERS = {
    "recorded_avoidance": RecordedAvoidanceParameters,
    "recorded_boxes": ScenePeopleParameters,
    "recorded_dynamics": MotionParameters,
    "recorded_ur10e": MotionParameters,
}


def main() -> None:
    parameters = {key: stage_parameters(key, model, PARAMETER_FILE) for key, model in PARAMETERS.items()}
    results = read_results(RecordedFiles(), parameters)
    report, drawn = recorded_report(results), recorded_pictures(results)
    publish_report("reports/recorded", report.pages, drawn, report.tables, report.metrics, report.headlines)


if __name__ == "__main__":
    run(main)
