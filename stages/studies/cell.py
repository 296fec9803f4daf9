"""Run a cell of a study: the stages of a testbed for other people or robots; keep tables of its report."""

import sys
from pathlib import Path

from structlearn.core.stage import run
from structlearn.reporting.study_tables import CELLS, read_descriptions, run_cell, write_cell


def main() -> None:
    name, cell = sys.argv[1:]
    tables = run_cell(name, read_descriptions()[name], cell, Path.cwd())
    write_cell(tables, CELLS / name / cell, Path.cwd())


if __name__ == "__main__":
    run(main)
