"""Record reaches without and past obstacles (dissertation IV.8.3)."""

from structlearn.artefacts import publish
from structlearn.obstacles.demonstrator import AvoiderParameters
from structlearn.obstacles.scenarios import SceneParameters, scenarios
from structlearn.obstacles.storage import record_scenarios
from structlearn.stage import run, stage_parameters


def main() -> None:
    scene = stage_parameters("obstacle_scene", SceneParameters)
    person = stage_parameters("obstacle_demonstrator", AvoiderParameters)
    with publish("data/raw/obstacles") as folder:
        record_scenarios(scenarios(scene), scene, person, folder)


if __name__ == "__main__":
    run(main)
