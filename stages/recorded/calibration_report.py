"""Report that compares simulated with recorded touch."""

from pathlib import Path

from dissertation.recorded.calibration.calibration_section import publish_calibration
from dissertation.recorded.calibration.touch_calibration import CalibrationParameters
from structlearn.core.artefacts import read_table
from structlearn.core.stage import run, stage_parameters

PARAMETERS = Path("../../src/dissertation/recorded/calibration/params.yaml")


def main() -> None:
    parameters = stage_parameters("calibrate", CalibrationParameters, PARAMETERS)
    stored = {path.stem: read_table(path) for path in sorted(Path("data/calibration").glob("*.parquet"))}
    publish_calibration(stored, parameters)


if __name__ == "__main__":
    run(main)
