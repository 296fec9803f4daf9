"""Record the nominal demonstrations (IV.9.1.3, step i)."""

from functools import partial

from structlearn.ground.artefacts import publish, write_metrics
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import write_recordings
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.engine_agreement import engine_differences
from structlearn.testbeds.scraping.world.guided_demonstrations import guided_demonstrations
from structlearn.testbeds.scraping.world.testbed import TestbedParameters


def main() -> None:
    demonstrator = stage_parameters("simulate", DemonstratorParameters)
    testbed = stage_parameters("testbed", TestbedParameters)
    recordings = guided_demonstrations(demonstrator, testbed)
    first = partial(guided_demonstrations, demonstrator.model_copy(update={"count": 1}))
    differences = engine_differences(first, testbed)
    with publish("data/raw/scraping/nominal") as folder:
        write_recordings(recordings, folder)
        write_metrics(differences, folder / "engines.json")


if __name__ == "__main__":
    run(main)
