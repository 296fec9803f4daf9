"""Record the nominal demonstrations (IV.9.1.3, step i)."""

from dissertation.scraping.world.demonstrator import DemonstratorParameters
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed, guided_demonstrations
from dissertation.simulation.individuals import drawn
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import write_recordings


def main() -> None:
    people = stage_parameters("simulate", DemonstratorParameters)
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    person, guidance = drawn(people, people.seed), drawn(testbed.guidance, people.seed)
    recordings = guided_demonstrations(person, guidance, testbed)
    with publish("data/raw/scraping/nominal") as folder:
        write_recordings(recordings, folder)


if __name__ == "__main__":
    run(main)
