"""Report of the obstacle testbed: figures, tables, findings and their page."""

from dissertation.evidence.claims import quoted_claims, quoted_people
from dissertation.evidence.judged_page import publish_judged
from dissertation.evidence.results import read_results, with_study
from dissertation.evidence.studies import OURS, RESULTS, stored_study
from dissertation.obstacles import files
from dissertation.obstacles.page.figures import figures
from dissertation.obstacles.page.findings import findings, read_published
from dissertation.obstacles.page.page import PEOPLE_STUDY, document
from dissertation.obstacles.page.shown import Shown, example_setting
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
    people = stage_parameters("obstacle_people", Population)
    places, scores = scenarios(parameters["obstacle_scene"]), read_table(files.SCORES_FILE)
    setting = example_setting(scores, people.shown)
    shown = Shown(
        scores=scores,
        paths=read_table(files.PATHS_FILE),
        demonstrated=read_table(files.PEOPLE_FILE),
        baseline=files.read_baselines()[people.shown],
        scenarios=places,
        demonstrations={
            place.shape: read_runs(f"{files.RUNS}/{place.name}.parquet")
            for place in places
            if place.setting == setting
        },
        population=people,
        recorded_people=quoted_people(),
        parameters=parameters,
    )
    study = stored_study(RESULTS / PEOPLE_STUDY)
    population = with_study(read_results("obstacles"), study, "person", people.test, variant=OURS)
    find = findings(population)
    page = document(population, shown, find, study)
    drawings = figures(population.results, shown, read_published()["largest_nmse"])
    publish_judged(files.REPORT, {"index": page}, drawings, page.tables, find, recorded=quoted_claims())


if __name__ == "__main__":
    run(main)
