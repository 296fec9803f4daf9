"""How long the stages took; `TIMES` is the only file that their wall times are written to.

Times differ from run to run, so they are in no artefact: the file is no output of a stage and nothing depends
on it. A stage that DVC runs enters its last time there, one run by hand does not.
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

from structlearn.ground.errors import InputError
from structlearn.ground.publication import publish

TIMES = Path("reports/times/stages.json")
"""Relative to the working directory, so an experiment in a directory of its own has times of its own."""

RUN_BY_DVC = "DVC_STAGE"
"""Environment variable that DVC sets while a stage runs."""


class StageTime(NamedTuple):
    """What one run of a stage took, from the start of Python.

    Attributes:
        wall_s: on the clock.
        cpu_s: of the processor, worker processes on this machine included.
    """

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
    """Enter the time of a stage; a time that cannot be written is told and fails nothing.

    Args:
        command: of the stage, without `python`.
        taken: rounded to 0.1 s.
        path: of the file, which is made anew where it is missing or damaged.
    """
    times = {**read_times(path), command: StageTime(*(round(value, 1) for value in taken))}
    entries = {name: times[name]._asdict() for name in sorted(times)}
    try:
        with publish(path) as target:
            target.write_text(json.dumps(entries, indent=2) + "\n")
    except (OSError, InputError) as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


def read_times(path: Path = TIMES) -> dict[str, StageTime]:
    """Times by command; none where the file is missing or damaged."""
    try:
        entries = json.loads(path.read_text()).items()
        return {name: StageTime(float(its["wall_s"]), float(its["cpu_s"])) for name, its in entries}
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def _since_start_s() -> float:
    """On the clock since this process started; where there is no /proc, since this was imported."""
    try:
        started_ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
    except OSError:
        return time.perf_counter() - _IMPORTED_S
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started_ticks / os.sysconf("SC_CLK_TCK")


_IMPORTED_S = time.perf_counter()
