"""Unroll the baseline past known, unseen, moving and several obstacles with every model (IV.8.4-8.7)."""

import pandas as pd

from structlearn.artefacts import publish, write_table
from structlearn.obstacles import protocols
from structlearn.obstacles.dataset import AvoidanceDataParameters
from structlearn.obstacles.learned_models import read_models
from structlearn.obstacles.scenarios import SceneParameters, scenarios
from structlearn.obstacles.storage import read_baseline, read_scenarios
from structlearn.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("obstacle_evaluation", protocols.AvoidanceEvaluationParameters)
    cloud_count = stage_parameters("obstacle_dataset", AvoidanceDataParameters).cloud_count
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    baseline = read_baseline("data/obstacles/dataset/baseline.safetensors")
    models = read_models("data/obstacles/models")
    demonstrations = read_scenarios(places, "data/raw/obstacles")

    found = [
        protocols.evaluate(situation, models, baseline, parameters)
        for situation in protocols.situations(places, baseline, parameters, cloud_count)
    ]
    scores, paths = (pd.concat(tables, ignore_index=True) for tables in zip(*found, strict=True))
    with publish("data/obstacles/evaluation") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(paths, folder / "paths.parquet")
        people = protocols.demonstration_scores(demonstrations, places, baseline, cloud_count)
        write_table(people, folder / "demonstrations.parquet")


if __name__ == "__main__":
    run(main)
