"""Learn from a task's reaches past obstacles, and test in scenes held out (IV.8)."""

import pandas as pd

from dissertation.recorded.coupling_representations import compare_representations, samples_of_reaches
from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, from_table
from structlearn.avoidance.scene_folds import learn_past_obstacles
from structlearn.core.artefacts import publish
from structlearn.tasks.task_entry import ObstacleEntry
from structlearn.tasks.task_files import TaskFiles, run_for_task, write_tables


def main(files: TaskFiles) -> None:
    parameters, results = files.entry(ObstacleEntry), dict[str, pd.DataFrame]()
    samples: AvoidanceDataset | None = None
    if (files.recorded / "samples.parquet").exists():
        samples = from_table(files.table("recorded/samples"))
    else:
        reaches = files.runs("reaches")
        results |= vars(learn_past_obstacles(reaches, parameters))
        if parameters.representations is not None:
            samples = samples_of_reaches(reaches, parameters)
    if samples is not None and parameters.representations is not None:
        results |= compare_representations(samples, parameters.representations)
    with publish(files.folder / "obstacles") as folder:
        folder.mkdir()
        write_tables(results, folder)


if __name__ == "__main__":
    run_for_task(main, out="obstacles")
