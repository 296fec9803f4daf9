"""Frame of stage scripts: checked parameters, one-line errors, and wall times.

A stage is a script that DVC runs from the project's root; it can be run by hand from there too. The wall time
of its last run by DVC is listed by `python -m structlearn.core.stage`. Times differ from run to run and from
machine to machine: they are in no artefact, no stage depends on them, and git does not keep them.
"""

import atexit
import fcntl
import json
import os
import re
import shlex
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import ParametersType, read_parameters
from structlearn.core.publication import alone_in, disk_fault, publish

PARAMETER_FILE = Path("params.yaml")
INTERRUPTED = 130
"""Exit code of what SIGINT ended, as shells have it."""

TIMES = Path("reports/times.json")
"""Relative to the working directory, so an experiment in a separate directory has separate times."""

RUN_BY_DVC = "DVC_STAGE"
"""Environment variable that DVC sets while a stage runs."""

_IMPORTED_S = time.perf_counter()


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


class StageTime(NamedTuple):
    """What one run of a stage took, from the start of Python, worker processes on this machine included."""

    wall_s: float
    cpu_s: float


def timed(main: Callable[[], None]) -> None:
    """Run a stage; if DVC runs it and it ends well, its time is written when the program ends.

    Worker processes end with the program, and the system counts a child's time when it has ended.
    """
    main()
    if RUN_BY_DVC in os.environ:
        # by its command: DVC's name of a stage depends on the folder that DVC is called in
        command, wall_s = shlex.join(sys.argv), _since_start_s()
        atexit.register(lambda: record(command, StageTime(wall_s, sum(os.times()[:4]))))


def record(command: str, taken: StageTime, path: Path = TIMES) -> None:
    """Enter the time of a stage, rounded to 0.1 s; one that cannot be written is told and fails nothing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with _one_at_a_time(path.parent), publish(path) as target:
            times = {**read_times(path), command: StageTime(*(round(value, 1) for value in taken))}
            target.write_text(json.dumps({name: times[name] for name in sorted(times)}, indent=1) + "\n")
    except (OSError, InputError) as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


@contextmanager
def _one_at_a_time(folder: Path) -> Iterator[None]:
    """Wait for other stages that end now: each adds its time to what the others wrote."""
    lock = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def read_times(path: Path = TIMES) -> dict[str, StageTime]:
    """Times by command, without `python`; none where the file is missing or damaged."""
    try:
        entries = json.loads(path.read_text()).items()
        return {name: StageTime(*map(float, its)) for name, its in entries}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def main() -> None:
    """Print the times of all stages, the longest first, and their sum."""
    times = read_times()
    total = StageTime(*(sum(values) for values in zip(*times.values(), strict=True))) if times else None
    print("  wall s    CPU s  stage, when it ran last")
    for command, its in sorted(times.items(), key=lambda entry: -entry[1].wall_s):
        print(f"{its.wall_s:8.1f} {its.cpu_s:8.1f}  {command}")
    if total:
        print(f"{total.wall_s:8.1f} {total.cpu_s:8.1f}  {len(times)} stages on {os.cpu_count()} cores")


def _since_start_s() -> float:
    """On the clock since this process started; where there is no /proc, since this was imported."""
    try:
        started_ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
    except OSError:
        return time.perf_counter() - _IMPORTED_S
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started_ticks / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
