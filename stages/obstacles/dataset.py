"""Learn the unhindered reach, and what hands do about obstacles as supervised data (IV.8.1, eq. IV.23)."""

from structlearn.avoidance.avoidance_dataset import (
    AvoidanceDataParameters,
    avoidance_dataset,
    fit_baseline,
    to_table,
)
from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings import read_demonstrations
from structlearn.testbeds.obstacles.files import BASELINE, read_scenarios, write_baseline
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios

RAW = "data/raw/obstacles"


def main() -> None:
    parameters = stage_parameters("obstacle_dataset", AvoidanceDataParameters)
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    baseline = fit_baseline(read_demonstrations(f"{RAW}/{BASELINE}"), parameters)
    sets = zip((place.obstacle for place in places), read_scenarios(places, RAW), strict=True)
    with publish("data/obstacles/dataset") as folder:
        folder.mkdir()
        write_baseline(baseline, folder / "baseline.safetensors")
        write_table(to_table(avoidance_dataset(sets, baseline, parameters)), folder / "samples.parquet")


if __name__ == "__main__":
    run(main)
