"""Write the bags of the example task, as a lab might record them: `make own-example`."""

from pathlib import Path

from structlearn.core.artefacts import publish
from structlearn.core.stage import run
from structlearn.tasks.pick_and_place_world import takes, write_takes

TARGET = Path("data/example/pick")
SEED, MOVES, COUNT = 1, 3, 6


def main() -> None:
    with publish(TARGET) as folder:
        folder.mkdir()
        write_takes(takes(SEED, MOVES, COUNT), folder)
    print(f"{TARGET}: {COUNT} bags")


if __name__ == "__main__":
    run(main)
