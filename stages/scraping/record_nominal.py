"""Record the nominal demonstrations: simulated, or taken over from your own bags (IV.9.1.3, step i)."""

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_recordings, write_recordings
from structlearn.recordings.source import SIMULATED, SourceParameters
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.guided_demonstrations import guided_demonstrations
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def main() -> None:
    parameters = stage_parameters("record", SourceParameters)
    if parameters.source == SIMULATED:
        demonstrator = stage_parameters("simulate", DemonstratorParameters)
        recordings = guided_demonstrations(demonstrator, stage_parameters("testbed", TestbedParameters))
    else:
        recordings = read_recordings(parameters.source, parameters.topics)
    with publish("data/raw/scraping/nominal") as folder:
        write_recordings(recordings, folder)


if __name__ == "__main__":
    run(main)
