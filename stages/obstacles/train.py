"""Train every person's avoidance models per setting, per shape and for all shapes (IV.8.5, IV.8.6)."""

from dissertation.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters, learn_avoidance
from dissertation.obstacles.world.scenarios import SceneParameters, scenarios
from structlearn.avoidance.avoidance_dataset import avoidance_from_table
from structlearn.avoidance.learned_models import write_avoidance_models
from structlearn.core.artefacts import publish, read_table, write_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters


def main() -> None:
    parameters = stage_parameters("obstacle_training", AvoidanceTrainingParameters)
    shown = stage_parameters("obstacle_people", Population).shown
    places = scenarios(stage_parameters("obstacle_scene", SceneParameters))
    samples = read_table("data/obstacles/dataset/samples.parquet")
    datasets = {person: avoidance_from_table(rows) for person, rows in samples.groupby("person", sort=False)}
    models, errors = learn_avoidance(datasets, places, parameters, shown)
    with publish("data/obstacles/models") as folder:
        folder.mkdir()
        for person, its in models.items():
            (folder / str(person)).mkdir()
            write_avoidance_models(its, folder / str(person))
        write_table(errors, folder / "errors.parquet")


if __name__ == "__main__":
    run(main)
