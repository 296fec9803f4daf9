"""Record the nominal demonstrations (IV.9.1.3, step i)."""

from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters, guided_demonstrations
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import write_recordings


def main() -> None:
    demonstrator = stage_parameters("simulate", DemonstratorParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    recordings = guided_demonstrations(demonstrator, testbed)
    with publish("data/raw/scraping/nominal") as folder:
        write_recordings(recordings, folder)


if __name__ == "__main__":
    run(main)
