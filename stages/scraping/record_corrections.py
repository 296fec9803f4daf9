"""Record corrected demonstrations on the tilted board, one set per setting (IV.9.1.3, iii)."""

from dissertation.scraping.protocol.execution_scores import ExecutionParameters
from dissertation.scraping.protocol.executions import executions, runs_to_correct
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.primitive_files import read_primitives
from structlearn.readers import write_recordings


def main() -> None:
    parameters = stage_parameters("record_corrections", ExecutionParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    skill = ReactiveSkill(read_primitives("data/primitives/scraping/primitives.safetensors"))
    runs = runs_to_correct(parameters.settings_deg, parameters.runs)
    recordings = executions(skill, runs, testbed)
    with publish("data/raw/scraping/corrections") as folder:
        folder.mkdir()
        for place, setting in enumerate(parameters.settings_deg):
            own = recordings[place * parameters.runs : (place + 1) * parameters.runs]
            write_recordings(own, folder / f"{setting:g}")


if __name__ == "__main__":
    run(main)
