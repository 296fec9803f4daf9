"""One cell of a study: run a testbed's stages for other people or robots, and keep their results."""

import sys
from pathlib import Path

from dissertation.evidence.study_cells import CELLS, make_cell, read_descriptions, write_cell
from structlearn.core.errors import InputError
from structlearn.core.stage import run


def main() -> None:
    descriptions, words = read_descriptions(), sys.argv[1:]
    if len(words) != 2 or words[0] not in descriptions:
        raise InputError(f"{sys.argv[0]}: needs a study and a cell of it; studies: {', '.join(descriptions)}")
    name, cell = words
    write_cell(*make_cell(name, descriptions[name], cell, Path.cwd()), CELLS / name / cell)


if __name__ == "__main__":
    run(main)
