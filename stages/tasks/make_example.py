"""Write the bags of the example task, in the form of a user's recordings: `make own-example`."""

from pathlib import Path

from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn.core.artefacts import publish
from structlearn.core.stage import run

TARGET = Path("data/example/pick")
SEED, MOVES, COUNT = 1, 3, 6


def main() -> None:
    with publish(TARGET) as folder:
        folder.mkdir()
        write_takes(takes(SEED, MOVES, COUNT), folder)
    print(f"{TARGET}: {COUNT} bags")


if __name__ == "__main__":
    run(main)
