"""The report that sets simulated touch beside recorded touch."""

from structlearn.core.stage import run, stage_parameters
from structlearn.reporting.publishing import publish_report
from structlearn.tasks.public import PARAMETER_FILE
from structlearn.tasks.public.page.calibration_figures import pictures
from structlearn.tasks.public.page.calibration_results import (
    HEADLINES,
    calibration_document,
    metrics,
    tables,
)
from structlearn.tasks.public.protocol.touch_calibration import CalibrationParameters
from structlearn.tasks.public.public_files import RecordedFiles


def main() -> None:
    parameters = stage_parameters("calibrate", CalibrationParameters, PARAMETER_FILE)
    stored = RecordedFiles().calibration()
    shown = tables(stored) if stored else {}
    pages = {"index": calibration_document(stored, shown, {"calibrate": parameters})}
    drawn = pictures(stored, parameters.variance) if stored else {}
    found = metrics(stored["comparison"]) if stored else {}
    publish_report("reports/calibration", pages, drawn, shown, found, HEADLINES if stored else ())


if __name__ == "__main__":
    run(main)
