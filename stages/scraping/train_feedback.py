"""Train feedback models: as published, with the level board, and within the unroll (IV.6.2.4, V.2)."""

from dissertation.scraping.files import read_datasets
from dissertation.scraping.protocol.feedback_models import FinalModelParameters, train_models
from structlearn.core.artefacts import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_model import write_networks
from structlearn.feedback.coupling_targets import SupervisionParameters


def main() -> None:
    parameters = stage_parameters("train_feedback", FinalModelParameters)
    settings = stage_parameters("coupling_dataset", SupervisionParameters).settings_deg
    datasets = read_datasets("data/feedback/scraping/dataset", settings)
    level = read_datasets("data/feedback/scraping/level")
    with publish("data/feedback/scraping/models") as folder:
        folder.mkdir()
        for model, networks in train_models(datasets, level, parameters).items():
            write_networks(networks, folder / f"{model}.safetensors")


if __name__ == "__main__":
    run(main)
