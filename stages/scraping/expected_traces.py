"""Execute the nominal primitives on the level board and learn expected sensor traces (IV.9.1.3, ii)."""

from dissertation.scraping.protocol.executions import executions, nominal_runs
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_targets import (
    ExpectedTracesParameters,
    SupervisionParameters,
    learn_expected,
)
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.primitive_files import read_primitives, write_vector_primitive
from structlearn.readers import synchronise, write_recordings
from structlearn.readers.demonstration import write_runs
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.segments import commanded_cuts


def main() -> None:
    parameters = stage_parameters("expected_traces", ExpectedTracesParameters)
    sensors = stage_parameters("coupling_dataset", SupervisionParameters).sensors
    clock = stage_parameters("clock", ClockParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    primitives = read_primitives("data/primitives/scraping/primitives.safetensors")

    runs, skill = nominal_runs(parameters.runs + parameters.level_runs), ReactiveSkill(primitives)
    executed = executions(skill, runs, testbed)
    with publish("data/raw/scraping/unrolls") as folder:
        # on the sensors' own clocks, for recorded.transfer.finger_statistics
        write_recordings(executed[: parameters.runs], folder)
    level = [synchronise(one, **clock.model_dump()) for one in executed]
    unrolls = level[: parameters.runs]
    write_runs(unrolls, "data/runs/scraping/unrolls.parquet")
    write_runs(level[parameters.runs :], "data/runs/scraping/level.parquet")

    with publish("data/feedback/scraping/expected") as folder:
        folder.mkdir()
        cuts = commanded_cuts(unrolls, [primitive.name for primitive in primitives])
        for name, traces in learn_expected(unrolls, cuts, parameters.smoothing_hz, sensors).items():
            note = "electrode counts without offset"
            write_vector_primitive(traces, folder / f"{name}.safetensors", note)


if __name__ == "__main__":
    run(main)
