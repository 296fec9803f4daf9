"""Frame of stage scripts: checked parameters, one-line errors, and timing.

A stage is a script that DVC runs from the project's root; it can be run by hand from there too.
"""

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import ParametersType, read_parameters
from structlearn.core.publication import alone_in, disk_fault, publish
from structlearn.core.wall_clock import RUN_BY_DVC, timed

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

    A second run of the stage at the same time ends in the same way, since their outputs would mix. So does
    Ctrl-C, with code `INTERRUPTED`. Errors of the program itself keep their traceback. When DVC runs the
    stage, its time is recorded.
    """
    try:
        with _alone():
            timed(main)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("error: interrupted; run it again", file=sys.stderr)
        sys.exit(INTERRUPTED)


@contextmanager
def _alone() -> Iterator[None]:
    """Lock the stage, for its task if it has one, against other processes in this folder."""
    script, *words = sys.argv
    package, path = Path(__file__).parents[1], Path(script).resolve()
    if path.is_relative_to(package) and path.parent.name != "stages":  # a command of the package
        yield
        return
    words = words or [os.environ.get(RUN_BY_DVC, "").partition("@")[2]]
    name = re.sub(r"\W+", "-", " ".join([os.path.relpath(script), *words])).strip("-")
    lock = Path(f".running-{name[-100:]}")
    with alone_in(lock, f"{script}: another process is running this stage"):
        try:
            yield
        finally:
            lock.rmdir()


def _in_one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Report a full disk in one line, also when numba saves compiled code."""
    fault = disk_fault(error) if isinstance(error, OSError) else None
    if fault is None:
        sys.__excepthook__(kind, error, trace)
    else:
        print(f"error: {getattr(error, 'filename', None) or 'a file'}: {fault}", file=sys.stderr)


sys.excepthook = _in_one_line
