"""Leave-one-demonstration-out comparison of feedback models (IV.9.3: table IV.5, figure IV.16)."""

from dissertation.scraping.files import read_datasets
from dissertation.scraping.protocol.feedback_models import compare_representations, paired_orderings
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.feedback.trainers import TrainingParameters

import pandas as pd


def main() -> None:
    parameters = stage_parameters("compare_models", TrainingParameters)
    settings = stage_parameters("coupling_dataset", SupervisionParameters).settings_deg
    datasets = read_datasets("data/feedback/scraping/dataset", settings)
    scores, orderings = [], []
    for name, found in compare_representations(datasets, parameters).items():
        scores.append(found.assign(primitive=name))
        orderings.append(paired_orderings(found).assign(primitive=name))
    with publish("data/feedback/scraping/comparison") as folder:
        folder.mkdir()
        for table, rows in (("scores", scores), ("orderings", orderings)):
            write_table(pd.concat(rows, ignore_index=True), folder / f"{table}.parquet")


if __name__ == "__main__":
    run(main)
