"""Table of results of the obstacle testbed."""

from dissertation.evidence.results import FOLDER
from dissertation.obstacles import files
from dissertation.obstacles.protocol.results import obstacle_results
from structlearn.core.artefacts import read_table, write_table
from structlearn.core.stage import run


def main() -> None:
    scores, demonstrated = read_table(files.SCORES_FILE), read_table(files.PEOPLE_FILE)
    write_table(
        obstacle_results(scores, demonstrated, read_table(files.ERRORS_FILE)), FOLDER / "obstacles.parquet"
    )


if __name__ == "__main__":
    run(main)
