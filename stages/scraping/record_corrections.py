"""Record corrected demonstrations on the tilted board, a set per setting (IV.9.1.3, iii)."""

from functools import partial
from pathlib import Path

from structlearn.feedback.skill import ReactiveSkill
from structlearn.ground.artefacts import publish, write_metrics
from structlearn.ground.stage import run, stage_parameters
from structlearn.primitives.primitive_files import read_primitives
from structlearn.recordings import read_recordings, write_recordings
from structlearn.recordings.source import CorrectionSourceParameters, SourceParameters
from structlearn.testbeds.scraping.protocol.executions import corrected_runs, executions
from structlearn.testbeds.scraping.world.engine_agreement import engine_differences
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def main() -> None:
    parameters = stage_parameters("record_corrections", CorrectionSourceParameters)
    record = stage_parameters("record", SourceParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    settings = [f"{setting:g}" for setting in parameters.settings_deg]

    sets, differences = {}, {}
    if parameters.source is not None:
        sets = {name: read_recordings(Path(parameters.source) / name, record.topics) for name in settings}
    elif record.simulated:
        skill = ReactiveSkill(read_primitives("data/primitives/scraping/primitives.safetensors"))
        runs = corrected_runs(parameters.settings_deg, parameters.runs)
        recordings = executions(skill, runs, testbed)
        differences = engine_differences(partial(executions, skill, runs[-1:]), testbed)
        for place, name in enumerate(settings):
            sets[name] = recordings[place * parameters.runs : (place + 1) * parameters.runs]
    with publish("data/raw/scraping/corrections") as folder:
        folder.mkdir()
        for name, recordings in sets.items():
            write_recordings(recordings, folder / name)
        write_metrics(differences, folder / "engines.json")


if __name__ == "__main__":
    run(main)
