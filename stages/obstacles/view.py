"""Rerun views: demonstrations past obstacles, reaches with learned models, unseen obstacles (IV.8)."""

from dissertation.obstacles import files
from dissertation.obstacles.protocol import avoidance_protocols, unrolled_reaches
from dissertation.obstacles.recordings import demonstrated_avoidance, unseen_avoidance
from dissertation.obstacles.world.scenarios import Scenario, SceneParameters, scenarios
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.core.artefacts import read_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import Demonstration, read_runs
from structlearn.viewer.recording import publish_recordings


def main() -> None:
    names = stage_parameters("inspect_obstacles", demonstrated_avoidance.ObstacleViewParameters).scenarios
    tested = stage_parameters("obstacle_evaluation", avoidance_protocols.AvoidanceEvaluationParameters)
    cloud_count = stage_parameters("obstacle_dataset", AvoidanceDataParameters).cloud_count
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    person = stage_parameters("obstacle_people", Population).shown
    baseline = files.read_baselines()[person]
    scores = read_table(files.SCORES_FILE).query("person == @person")
    reaches = unrolled_reaches.reaches_by_situation(read_table(files.PATHS_FILE), scores, baseline)
    samples = read_table(files.SAMPLES_FILE).query("person == @person")

    def recorded(place: Scenario) -> list[Demonstration]:
        return read_runs(f"{files.RUNS}/{place.name}.parquet")

    shown = demonstrated_avoidance.shown_scenarios(places, names, recorded, samples, reaches, cloud_count)
    hit = {number for _, number in unrolled_reaches.hit_settings(reaches, avoidance_protocols.TRAINED)}
    settings = [(place, place.setting in hit) for place in places if place.shape == places[0].shape]
    unseen = avoidance_protocols.unseen_scenarios(baseline)
    beyond = [
        avoidance_protocols.moving(baseline, tested),
        avoidance_protocols.pairs(baseline, tested),
        avoidance_protocols.goal_change(baseline, tested),
    ]

    unhindered = read_runs(f"{files.RUNS}/{files.BASELINE}.parquet")
    recordings = {
        "demonstrations": demonstrated_avoidance.demonstrations(shown, unhindered, baseline, settings),
        "trained": demonstrated_avoidance.trained(shown),
        "unseen": unseen_avoidance.unseen(unseen, unrolled_reaches.groups_of(unseen, reaches), baseline),
        "beyond": unseen_avoidance.changing(beyond, reaches, baseline),
    }
    publish_recordings(files.RECORDINGS, recordings)


if __name__ == "__main__":
    run(main)
