"""Train latent spaces of touch and their dynamics, and compare them (II.4.2 to II.4.5)."""

from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.tactile.geodesics import read_geodesics
from structlearn.tactile.latent_comparison import learn_latent_spaces
from structlearn.tactile.latent_models import write_latent_models
from structlearn.tactile.latent_parameters import LatentParameters
from structlearn.tactile.touch_dataset import read_dataset


def main() -> None:
    parameters = stage_parameters("train_latent", LatentParameters)
    dataset = read_dataset("data/servoing/touch.safetensors")
    geodesics = read_geodesics("data/servoing/geodesics.safetensors")
    comparison = learn_latent_spaces(dataset, geodesics, parameters)
    write_latent_models(comparison.models, comparison.units, "data/servoing/models.safetensors")
    with publish("data/servoing/evaluation") as folder:
        folder.mkdir()
        for name, table in comparison.tables.items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run(main)
