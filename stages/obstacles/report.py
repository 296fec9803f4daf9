"""Report of the obstacle testbed: figures, tables, findings and their page."""

from dissertation.evidence.claims import quoted_claims
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.studies import read_study
from dissertation.obstacles import files
from dissertation.obstacles.page.figures import figures
from dissertation.obstacles.page.findings import (
    PEOPLE_STUDY,
    ObstacleResults,
    example_setting,
    findings,
    read_published,
)
from dissertation.obstacles.page.page import document
from dissertation.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters
from dissertation.obstacles.protocol.avoidance_protocols import AvoidanceEvaluationParameters
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.core.artefacts import read_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import read_runs

PARAMETERS = {
    "obstacle_scene": SceneParameters,
    "obstacle_demonstrator": AvoiderParameters,
    "obstacle_dataset": AvoidanceDataParameters,
    "obstacle_training": AvoidanceTrainingParameters,
    "obstacle_evaluation": AvoidanceEvaluationParameters,
}


def main() -> None:
    parameters = {key: stage_parameters(key, model) for key, model in PARAMETERS.items()}
    places = scenarios(parameters["obstacle_scene"])
    scores = read_table(files.SCORES_FILE)
    population = stage_parameters("obstacle_people", Population)
    setting = example_setting(scores, population.shown)
    shown = [place for place in places if place.setting == setting]
    results = ObstacleResults(
        scores=scores,
        paths=read_table(files.PATHS_FILE),
        demonstration_scores=read_table(files.PEOPLE_FILE),
        errors=read_table(files.ERRORS_FILE),
        baselines=files.read_baselines(),
        scenarios=places,
        demonstrations={place.shape: read_runs(f"{files.RUNS}/{place.name}.parquet") for place in shown},
        population=population,
        parameters=parameters,
        study=read_study(PEOPLE_STUDY),
    )
    published = read_published()
    find = findings(results, published)
    page, drawings = document(results, find), figures(results, published["largest_nmse"])
    publish_judged(files.REPORT, {"index": page}, drawings, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
