"""The report of the obstacle testbed: figures, tables, metrics and the page that shows them."""

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.ground.artefacts import read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.reporting.page import Link
from structlearn.reporting.publishing import publish_report
from structlearn.testbeds.obstacles.files import read_baseline, read_scenarios
from structlearn.testbeds.obstacles.page.obstacle_page import obstacle_page
from structlearn.testbeds.obstacles.page.obstacle_results import ObstacleResults, example_setting, metrics
from structlearn.testbeds.obstacles.page.obstacle_sections import pictures
from structlearn.testbeds.obstacles.page.obstacle_tables import tables
from structlearn.testbeds.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import AvoidanceEvaluationParameters
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

PARAMETERS = {
    "obstacle_scene": SceneParameters,
    "obstacle_demonstrator": AvoiderParameters,
    "obstacle_dataset": AvoidanceDataParameters,
    "obstacle_training": AvoidanceTrainingParameters,
    "obstacle_evaluation": AvoidanceEvaluationParameters,
}
RECORDINGS = {
    "demonstrations": "reaches without and past obstacles, with their surfaces",
    "trained": "unrolls past trained obstacles, with their coupling terms",
    "unseen": "unrolls past unseen spheres",
    "beyond": "moving spheres, two spheres and a moving goal",
}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    places = scenarios(parameters["obstacle_scene"])
    scores = read_table("data/obstacles/evaluation/scores.parquet")
    setting = example_setting(scores)
    shown = [scenario for scenario in places if scenario.setting == setting]
    demonstrations = read_scenarios(shown, "data/raw/obstacles")
    results = ObstacleResults(
        scores=scores,
        paths=read_table("data/obstacles/evaluation/paths.parquet"),
        people=read_table("data/obstacles/evaluation/demonstrations.parquet"),
        errors=read_table("data/obstacles/models/errors.parquet"),
        baseline=read_baseline("data/obstacles/dataset/baseline.safetensors"),
        scenarios=places,
        shown={scenario.shape: its for scenario, its in zip(shown, demonstrations, strict=True)},
        scene=parameters["obstacle_scene"],
        person=parameters["obstacle_demonstrator"],
        data=parameters["obstacle_dataset"],
        training=parameters["obstacle_training"],
        evaluation=parameters["obstacle_evaluation"],
    )
    links = [
        Link(f"../recordings/obstacles/{name}.rrd", f"{name}.rrd", note) for name, note in RECORDINGS.items()
    ]
    publish_report(
        "reports/obstacles",
        pictures(results),
        tables(results),
        metrics(results),
        lambda sizes: obstacle_page(results, sizes, parameters, links),
    )


if __name__ == "__main__":
    run(main)
