"""Recordings to look at: demonstrations past obstacles, what models do, and unseen obstacles (IV.8)."""

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.ground.artefacts import publish, read_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.testbeds.obstacles.files import BASELINE, read_baseline, read_scenarios
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.recordings.changing_avoidance import write_changing_avoidance
from structlearn.testbeds.obstacles.recordings.demonstrated_avoidance import write_avoidance_demonstrations
from structlearn.testbeds.obstacles.recordings.shown_reaches import (
    ObstacleViewParameters,
    ShownScenario,
    SituationKey,
    chosen_scenarios,
    hit_settings,
    reaches_by_situation,
)
from structlearn.testbeds.obstacles.recordings.trained_avoidance import write_trained_avoidance
from structlearn.testbeds.obstacles.recordings.unseen_avoidance import write_unseen_avoidance
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

RAW, DATASET, EVALUATION = "data/raw/obstacles", "data/obstacles/dataset", "data/obstacles/evaluation"


def main() -> None:
    chosen = stage_parameters("inspect_obstacles", ObstacleViewParameters)
    tested = stage_parameters("obstacle_evaluation", avoidance_protocols.AvoidanceEvaluationParameters)
    cloud_count = stage_parameters("obstacle_dataset", AvoidanceDataParameters).cloud_count
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    baseline = read_baseline(f"{DATASET}/baseline.safetensors")
    samples = read_table(f"{DATASET}/samples.parquet")
    tables = (read_table(f"{EVALUATION}/{name}.parquet") for name in ("paths", "scores"))
    reaches = reaches_by_situation(*tables, baseline)
    found = chosen_scenarios(places, chosen.scenarios)
    shown = [
        ShownScenario(
            scenario,
            scenario.obstacle.cloud(cloud_count),
            people,
            samples[samples["scenario"] == number],
            reaches[SituationKey(avoidance_protocols.TRAINED, scenario.shape, scenario.setting)],
        )
        for (number, scenario), people in zip(
            found.items(), read_scenarios(list(found.values()), RAW), strict=True
        )
    ]
    hit = {number for _, number in hit_settings(reaches, avoidance_protocols.TRAINED)}
    settings = [(place, place.setting in hit) for place in places if place.shape == places[0].shape]

    with publish("reports/recordings/obstacles") as folder:
        folder.mkdir()
        write_avoidance_demonstrations(
            folder / "demonstrations.rrd",
            shown,
            read_demonstrations(f"{RAW}/{BASELINE}"),
            baseline,
            settings,
            "Obstacles: demonstrations",
        )
        write_trained_avoidance(folder / "trained.rrd", shown, "Obstacles: trained scenarios")
        write_unseen_avoidance(
            folder / "unseen.rrd",
            avoidance_protocols.unseen(baseline),
            reaches,
            baseline,
            "Obstacles: unseen spheres",
        )
        changing = [
            avoidance_protocols.moving(baseline, tested),
            avoidance_protocols.pairs(baseline, tested),
            avoidance_protocols.goal_change(baseline, tested),
        ]
        write_changing_avoidance(
            folder / "beyond.rrd", changing, reaches, baseline, "Obstacles: beyond the dissertation"
        )


if __name__ == "__main__":
    run(main)
