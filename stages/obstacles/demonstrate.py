"""Simulate a person's reaches without and around obstacles: 1 800 reaches (dissertation IV.8.3)."""

from functools import partial

from structlearn.core.artefacts import publish
from structlearn.core.parallel import parallel_map
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import write_runs
from structlearn.testbeds.obstacles.files import BASELINE, RUNS
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, captured
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios


def main() -> None:
    scene = stage_parameters("obstacle_scene", SceneParameters)
    person = stage_parameters("obstacle_demonstrator", AvoiderParameters)
    places = scenarios(scene)
    reach = partial(captured, scene=scene, person=person)
    reaches = parallel_map(reach, [None, *places], "demonstrations past obstacles", local=True)
    names = [BASELINE, *(place.name for place in places)]
    with publish(RUNS) as folder:
        for name, its in zip(names, reaches, strict=True):
            write_runs(its, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
