"""Simulate reaches of a person, without and past obstacles, as demonstrations (dissertation IV.8.3)."""

from functools import partial

from dissertation.obstacles.files import BASELINE, RUNS
from dissertation.obstacles.world.reaching_person import AvoiderParameters, captured
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from dissertation.simulation.individuals import drawn
from structlearn.core.artefacts import publish
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import write_runs


def main() -> None:
    scene = stage_parameters("obstacle_scene", SceneParameters)
    people = stage_parameters("obstacle_demonstrator", AvoiderParameters)
    places = scenarios(scene)
    reach = partial(captured, scene=scene, person=drawn(people, people.seed))
    reaches = parallel_map(reach, [None, *places], "demonstrations past obstacles", local=True)
    names = [BASELINE, *(place.name for place in places)]
    with publish(RUNS) as folder:
        for name, its in zip(names, reaches, strict=True):
            write_runs(its, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
