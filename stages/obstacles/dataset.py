"""Learn unhindered reaches, and turn reaches past obstacles into supervised data (IV.8.1, eq. IV.23)."""

from functools import partial

from dissertation.obstacles.files import RUNS, write_baselines
from dissertation.obstacles.protocol.avoidance_scores import person_data
from dissertation.obstacles.world.reaching_person import AvoiderParameters
from dissertation.obstacles.world.scenarios import SceneParameters
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters

import pandas as pd


def main() -> None:
    population = stage_parameters("obstacle_people", Population)
    teach = partial(
        person_data,
        recorded=RUNS,
        scene=stage_parameters("obstacle_scene", SceneParameters),
        people=stage_parameters("obstacle_demonstrator", AvoiderParameters),
        parameters=stage_parameters("obstacle_dataset", AvoidanceDataParameters),
    )
    people = [population.shown, *population.test]
    found = parallel_map(teach, people, "what people do past obstacles", local=True)
    baselines, samples, scores = zip(*found, strict=True)
    with publish("data/obstacles/dataset") as folder:
        folder.mkdir()
        write_baselines(dict(zip(people, baselines, strict=True)), folder / "baselines.safetensors")
        write_table(pd.concat(samples, ignore_index=True), folder / "samples.parquet")
        write_table(pd.concat(scores, ignore_index=True), folder / "demonstrations.parquet")


if __name__ == "__main__":
    run(main)
