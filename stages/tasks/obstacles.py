"""Learn from the reaches of a task past obstacles, and try what was learned in scenes left out (IV.8)."""

from structlearn.avoidance.scene_people import learn_past_obstacles
from structlearn.core.artefacts import publish, write_table
from structlearn.tasks.task_entry import ObstacleEntry
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    results = learn_past_obstacles(files.runs("reaches"), files.entry(ObstacleEntry))
    with publish(files.folder / "obstacles") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run_for_task(main, out="obstacles")
