"""Touch statistics of recordings and of the simulated robot's nominal executions, to compare both."""

from pathlib import Path

from dissertation.recorded.calibration.touch_calibration import (
    CalibrationParameters,
    calibration_tables,
    calibration_traces,
    in_sets,
)
from structlearn.core.artefacts import publish
from structlearn.core.errors import MissingInputError
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.readers import read_recordings
from structlearn.readers.demonstration import read_streams
from structlearn.tasks.task_files import TaskFiles, write_tables

CLONE = Path("../..")  # of the project of public sets
SIMULATED = CLONE / "data/raw/scraping/unrolls"
PARAMETERS = CLONE / "src/dissertation/recorded/calibration/params.yaml"


def main() -> None:
    parameters = stage_parameters("calibrate", CalibrationParameters, PARAMETERS)
    files = TaskFiles("biotac")
    if files.absent:
        raise MissingInputError(files.absent)
    recorded = in_sets(read_streams(files.recorded / "streams.parquet"))
    simulated = read_recordings(SIMULATED) if any(SIMULATED.iterdir()) else []
    tables = calibration_tables(calibration_traces(recorded, simulated, parameters), parameters)
    with publish("data/calibration") as folder:
        folder.mkdir()
        write_tables(tables, folder)


if __name__ == "__main__":
    run(or_empty(main, "data/calibration"))
