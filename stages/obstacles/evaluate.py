"""Unroll reaches past known, unseen, moving and several obstacles with every person's models (IV.8.4-8.7)."""

from functools import partial

from dissertation.obstacles.files import read_baselines
from dissertation.obstacles.protocol import avoidance_protocols
from dissertation.obstacles.world.scenarios import SceneParameters, own_scenarios, scenarios
from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.learned_models import read_avoidance_models
from structlearn.core.artefacts import publish, write_table
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters

import pandas as pd


def main() -> None:
    parameters = stage_parameters("obstacle_evaluation", avoidance_protocols.AvoidanceEvaluationParameters)
    cloud_count = stage_parameters("obstacle_dataset", AvoidanceDataParameters).cloud_count
    shown = stage_parameters("obstacle_people", Population).shown
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    baselines = read_baselines("data/obstacles/dataset/baselines.safetensors")
    own = own_scenarios(places, list(baselines))
    learners = [
        avoidance_protocols.Learner(
            person, baseline, read_avoidance_models(f"data/obstacles/models/{person}"), own[person]
        )
        for person, baseline in baselines.items()
    ]

    evaluate = partial(avoidance_protocols.evaluate_avoidance, parameters=parameters, with_paths_of=shown)
    work = [
        (learner, situation)
        for learner in learners
        for situation in avoidance_protocols.situations(places, learner.baseline, parameters, cloud_count)
    ]
    found = parallel_map(evaluate, work, "unrolling past obstacles")
    scores, paths = (pd.concat(tables, ignore_index=True) for tables in zip(*found, strict=True))
    with publish("data/obstacles/evaluation") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(paths, folder / "paths.parquet")


if __name__ == "__main__":
    run(main)
