"""Wall time of each stage in its last run by DVC: `python -m structlearn.core.wall_clock` lists it.

Times differ from run to run and from machine to machine: they are in no artefact, no stage depends on them,
and git does not keep them.
"""

import atexit
import json
import os
import shlex
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from structlearn.core.errors import InputError
from structlearn.core.publication import publish

TIMES = Path("reports/times.json")
"""Relative to the working directory, so an experiment in a separate directory has separate times."""

RUN_BY_DVC = "DVC_STAGE"
"""Environment variable that DVC sets while a stage runs."""


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
    times = {**read_times(path), command: StageTime(*(round(value, 1) for value in taken))}
    try:
        with publish(path) as target:
            target.write_text(json.dumps({name: times[name] for name in sorted(times)}, indent=1) + "\n")
    except (OSError, InputError) as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


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


_IMPORTED_S = time.perf_counter()

if __name__ == "__main__":
    main()
