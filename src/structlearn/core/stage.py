"""Frame of stage scripts: checked parameters, one-line errors, and timing.

A stage is a script that DVC runs from the project's root; it can be run by hand from there too.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import ParametersType, read_parameters
from structlearn.core.publication import publish
from structlearn.core.wall_clock import timed

PARAMETER_FILE = Path("params.yaml")
INTERRUPTED = 130
"""Exit code of what SIGINT ended, as shells have it."""


def stage_parameters(key: str, model: type[ParametersType], path: Path = PARAMETER_FILE) -> ParametersType:
    """Parameters of one stage of its pipeline, in the working directory (see `read_parameters`)."""
    return read_parameters(path, key, model)


def or_empty(main: Callable[[], None], target: str | Path) -> Callable[[], None]:
    """`main`, which leaves an empty folder at `target` and says why where its input is missing."""

    def made() -> None:
        try:
            main()
        except MissingInputError as missing:
            print(f"{target}: left empty: {missing}")
            with publish(target) as folder:
                folder.mkdir()

    return made


def run(main: Callable[[], None]) -> None:
    """Run a stage; bad input becomes one line on standard error and exit code 1.

    So does Ctrl-C, with code `INTERRUPTED`. Errors of the program itself keep their traceback. When DVC runs
    the stage, its time is recorded.
    """
    try:
        timed(main)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("error: interrupted; run it again", file=sys.stderr)
        sys.exit(INTERRUPTED)
