"""Entry point of stage scripts: checked parameters, one-line errors, and wall times.

A stage is a script that DVC runs from the project's root, and that can be run by hand from there too.
`python -m structlearn.core.stage` lists the wall time of each stage's last run by DVC. Times are in no
artefact that stages depend on or that git tracks.
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
from structlearn.core.processor import require_pins
from structlearn.core.publication import alone_in, disk_fault, publish
from structlearn.core.shadowing import require_own_packages
from structlearn.core.used_files import watched

PARAMETER_FILE = Path("params.yaml")
INTERRUPTED = 130  # exit code after SIGINT, as in shells
TIMES = Path("reports/times.json")  # in the working directory, so experiments elsewhere keep their own times
RUN_BY_DVC = "DVC_STAGE"  # environment variable that DVC sets while a stage runs
_IMPORTED_S = time.perf_counter()


def stage_parameters(key: str, model: type[ParametersType], path: Path = PARAMETER_FILE) -> ParametersType:
    """Parameters of one stage of its pipeline, in the working directory (see `read_parameters`)."""
    return read_parameters(path, key, model)


def or_empty(main: Callable[[], None], target: str | Path) -> Callable[[], None]:
    """Wrap `main` to leave an empty folder at `target` and print the reason if its input is missing."""

    def made() -> None:
        try:
            main()
        except MissingInputError as missing:
            print(f"{target}: left empty: {missing}")
            with publish(target) as folder:
                folder.mkdir()

    return made


def run(main: Callable[[], None], stage: bool = True) -> None:
    """Run a stage; bad input becomes one line on standard error and exit code 1.

    So do packages hidden by PYTHONPATH, a change of what the stage uses while it runs (`used_files`), a
    concurrent run of the same stage, and Ctrl-C with code `INTERRUPTED`. Bugs keep their traceback. If DVC
    runs the stage, its time is recorded. Stages give the same bits on all processors (`processor`): one that
    loaded a library too early starts again. `stage`: False for commands, which may run stages and wait, and
    for programs outside of a pipeline.
    """
    try:
        require_own_packages()
        if stage:
            require_pins()
            with _alone():
                timed(watched(_started_s())(main))
        else:
            timed(main)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("error: interrupted; run it again", file=sys.stderr)
        sys.exit(INTERRUPTED)


@contextmanager
def _alone() -> Iterator[None]:
    """Lock the stage (of its task, if it has one) against other processes in this folder."""
    script, *words = sys.argv
    words = words or [os.environ.get(RUN_BY_DVC, "").partition("@")[2]]
    name = re.sub(r"\W+", "-", " ".join([os.path.relpath(script), *words])).strip("-")
    lock = Path(f".running-{name[-100:]}")
    with alone_in(lock, f"{script}: another process is running this stage"):
        try:
            yield
        finally:
            lock.rmdir()


def _in_one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Report a full disk in one line, also when raised while numba saves compiled code."""
    fault = disk_fault(error) if isinstance(error, OSError) else None
    if fault is None:
        _previous_hook(kind, error, trace)
    else:
        print(f"error: {getattr(error, 'filename', None) or 'a file'}: {fault}", file=sys.stderr)


_previous_hook, sys.excepthook = sys.excepthook, _in_one_line


class StageTime(NamedTuple):
    """Time that a stage took since the start of Python, including worker processes on this machine."""

    wall_s: float
    cpu_s: float


def timed(main: Callable[[], None]) -> None:
    """Run a stage; if run by DVC, record its time at exit, when worker processes have been counted."""
    main()
    if RUN_BY_DVC in os.environ:
        # by command, because DVC's name of a stage depends on the folder that DVC is called in
        command, wall_s = shlex.join(sys.argv), _since_start_s()
        atexit.register(lambda: record(command, StageTime(wall_s, sum(os.times()[:4]))))


def record(command: str, taken: StageTime, path: Path = TIMES) -> None:
    """Record the time of a stage, rounded to 0.1 s; prints a warning if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = os.open(path.parent, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)  # other stages may finish at the same time
            times = {**read_times(path), command: StageTime(*(round(value, 1) for value in taken))}
            with publish(path) as target:
                target.write_text(json.dumps(times, indent=1, sort_keys=True) + "\n")
        finally:
            os.close(lock)
    except (OSError, InputError) as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


def read_times(path: Path = TIMES) -> dict[str, StageTime]:
    """Times by command, without `python`; empty if the file is missing or damaged."""
    try:
        return {name: StageTime(*map(float, spent)) for name, spent in json.loads(path.read_text()).items()}
    except (OSError, ValueError, TypeError, AttributeError):
        return {}


def main() -> None:
    """Print the times of all stages in falling order, and their sum."""
    times = sorted(read_times().items(), key=lambda entry: -entry[1].wall_s)
    print("  wall s    CPU s  stage, when it ran last")
    for command, spent in times:
        print(f"{spent.wall_s:8.1f} {spent.cpu_s:8.1f}  {command}")
    if times:
        wall_s, cpu_s = (sum(values) for values in zip(*(spent for _, spent in times), strict=True))
        print(f"{wall_s:8.1f} {cpu_s:8.1f}  {len(times)} stages on {os.cpu_count()} cores")


def _started_s() -> float:
    """Time of this process's start on the clock of files."""
    since_s = _since_start_s()  # first: a pause before the next line may only make the start seem later
    return time.time() - since_s


def _since_start_s() -> float:
    """Wall time since this process started; without /proc, since this module was imported."""
    try:
        started_ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
    except OSError:
        return time.perf_counter() - _IMPORTED_S
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started_ticks / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
