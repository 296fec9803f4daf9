"""Record reaches without and past obstacles (dissertation IV.8.3)."""

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run, stage_parameters
from structlearn.testbeds.obstacles.files import record_scenarios
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios


def main() -> None:
    scene = stage_parameters("obstacle_scene", SceneParameters)
    person = stage_parameters("obstacle_demonstrator", AvoiderParameters)
    with publish("data/raw/obstacles") as folder:
        record_scenarios(scenarios(scene), scene, person, folder)


if __name__ == "__main__":
    run(main)
