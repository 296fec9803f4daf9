"""The report that sets simulated touch beside recorded touch."""

from dataclasses import fields

from structlearn.ground.artefacts import read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.recorded.page.calibration_page import calibration_page, pictures
from structlearn.testbeds.recorded.page.calibration_results import CalibrationResults, metrics, tables
from structlearn.testbeds.recorded.protocol.touch_calibration import CalibrationParameters


def main() -> None:
    parameters = stage_parameters("calibrate", CalibrationParameters)
    results = CalibrationResults(
        **{
            field.name: read_table(f"data/recorded/calibration/{field.name}.parquet")
            for field in fields(CalibrationResults)
        }
    )
    publish_report(
        "reports/calibration",
        pictures(results, parameters),
        tables(results),
        metrics(results),
        lambda sizes: calibration_page(results, sizes, "calibrate", parameters),
    )


if __name__ == "__main__":
    run(main)
