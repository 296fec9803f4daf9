"""Learn from the reaches of a task past obstacles, and try what was learned in scenes left out (IV.8)."""

from pathlib import Path

from structlearn.ground.artefacts import publish, write_table
from structlearn.recordings import read_demonstrations
from structlearn.recordings.stamps import StampPolicy
from structlearn.testbeds.own.files import TaskFiles, local_path, run_for_task
from structlearn.testbeds.own.protocol.own_obstacles import EVERYBODY, learn_past_obstacles
from structlearn.testbeds.own.protocol.own_obstacles_parameters import ObstacleParameters


def folders(source: Path) -> dict[str, Path]:
    """Where the reaches of each person are."""
    inside = sorted(source.iterdir()) if source.is_dir() else []
    people = [path for path in inside if path.is_dir() and not path.name.startswith(".")]
    people = [path for path in people if not (path / "metadata.yaml").exists()]  # those are bags
    return {path.name: path for path in people} or {EVERYBODY: source}


def main(files: TaskFiles) -> None:
    parameters = files.part("obstacles", ObstacleParameters)
    clock = files.clock.model_dump() | {"stamps": files.part("stamps", StampPolicy)}
    recordings = {
        person: read_demonstrations(folder, parameters.topics, **clock)
        for person, folder in folders(local_path(parameters.source)).items()
    }
    results = learn_past_obstacles(recordings, parameters)
    with publish(files.folder / "obstacles") as folder:
        folder.mkdir()
        for name, table in vars(results).items():
            write_table(table, folder / f"{name}.parquet")


if __name__ == "__main__":
    run_for_task(main, "obstacles", "obstacles")
