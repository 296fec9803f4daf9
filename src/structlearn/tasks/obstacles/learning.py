"""Learning from a task's reaches past obstacles, tested in scenes held out (IV.8)."""

from pathlib import Path

from structlearn.avoidance.scene_folds import learn_past_obstacles
from structlearn.tasks.obstacles.parameters import ObstacleParameters
from structlearn.tasks.task_files import TaskFiles, write_tables


def learn(files: TaskFiles, folder: Path) -> None:
    """Write the tables of `SceneResults`."""
    found = learn_past_obstacles(files.runs("reaches"), files.entry(ObstacleParameters))
    write_tables(vars(found), folder)
