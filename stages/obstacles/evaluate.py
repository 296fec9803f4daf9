"""Unroll the baseline past known, unseen, moving and several obstacles with every model (IV.8.4-8.7)."""

from functools import partial

import pandas as pd

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.learned_models import read_models
from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.parallel import parallel_map
from structlearn.ground.stage import run, stage_parameters
from structlearn.testbeds.obstacles.files import read_baseline, read_scenarios
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.world.scenarios import SceneParameters, scenarios


def main() -> None:
    parameters = stage_parameters("obstacle_evaluation", avoidance_protocols.AvoidanceEvaluationParameters)
    cloud_count = stage_parameters("obstacle_dataset", AvoidanceDataParameters).cloud_count
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    baseline = read_baseline("data/obstacles/dataset/baseline.safetensors")
    models = read_models("data/obstacles/models")
    demonstrations = read_scenarios(places, "data/raw/obstacles")

    evaluate = partial(avoidance_protocols.evaluate, models=models, baseline=baseline, parameters=parameters)
    situations = avoidance_protocols.situations(places, baseline, parameters, cloud_count)
    found = parallel_map(evaluate, situations, "unrolling past obstacles")
    scores, paths = (pd.concat(tables, ignore_index=True) for tables in zip(*found, strict=True))
    with publish("data/obstacles/evaluation") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(paths, folder / "paths.parquet")
        people = avoidance_protocols.demonstration_scores(demonstrations, places, baseline, cloud_count)
        write_table(people, folder / "demonstrations.parquet")


if __name__ == "__main__":
    run(main)
