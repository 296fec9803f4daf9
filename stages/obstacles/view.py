"""Rerun views: demonstrations past obstacles, reaches with learned models, unseen obstacles (IV.8)."""

from dissertation.obstacles import files
from dissertation.obstacles.protocol import avoidance_protocols, unrolled_reaches
from dissertation.obstacles.recordings.demonstrated_avoidance import (
    ObstacleViewParameters,
    shown_scenarios,
    write_avoidance_demonstrations,
    write_trained_avoidance,
)
from dissertation.obstacles.recordings.unseen_avoidance import (
    write_changing_avoidance,
    write_unseen_avoidance,
)
from dissertation.obstacles.world.scenarios import Scenario, SceneParameters, scenarios
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.core.artefacts import publish, read_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.readers.demonstration import Demonstration, read_runs


def main() -> None:
    names = stage_parameters("inspect_obstacles", ObstacleViewParameters).scenarios
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

    shown = shown_scenarios(places, names, recorded, samples, reaches, cloud_count)
    hit = {number for _, number in unrolled_reaches.hit_settings(reaches, avoidance_protocols.TRAINED)}
    settings = [(place, place.setting in hit) for place in places if place.shape == places[0].shape]
    unseen = avoidance_protocols.unseen_scenarios(baseline)
    beyond = [
        avoidance_protocols.moving(baseline, tested),
        avoidance_protocols.pairs(baseline, tested),
        avoidance_protocols.goal_change(baseline, tested),
    ]

    with publish(files.RECORDINGS) as folder:
        folder.mkdir()
        write_avoidance_demonstrations(
            folder / "demonstrations.rrd",
            shown,
            read_runs(f"{files.RUNS}/{files.BASELINE}.parquet"),
            baseline,
            settings,
            "Obstacles: demonstrations",
        )
        write_trained_avoidance(folder / "trained.rrd", shown, "Obstacles: trained scenarios")
        groups = unrolled_reaches.groups_of(unseen, reaches)
        write_unseen_avoidance(folder / "unseen.rrd", unseen, groups, baseline, "Obstacles: unseen spheres")
        title = "Obstacles: beyond the dissertation"
        write_changing_avoidance(folder / "beyond.rrd", beyond, reaches, baseline, title)


if __name__ == "__main__":
    run(main)
