"""One cell of a study: run a testbed's stages for other people or robots, and keep the report's tables."""

import sys
from pathlib import Path

from dissertation.evidence.study_tables import CELLS, read_descriptions, run_cell, write_cell
from structlearn.core.stage import run


def main() -> None:
    name, cell = sys.argv[1:]
    tables = run_cell(name, read_descriptions()[name], cell, Path.cwd())
    write_cell(tables, CELLS / name / cell, Path.cwd())


if __name__ == "__main__":
    run(main)
