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
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path

from structlearn.ground.errors import InputError
from structlearn.ground.publication import publish

TIMES = Path("reports/times/stages.json")
"""Relative to the working directory, so an experiment in a directory of its own has times of its own."""

RUN_BY_DVC = "DVC_STAGE"
"""Environment variable that DVC sets while a stage runs."""


@dataclass(frozen=True)
class SharedWork:
    """What a loop over processes took.

    Attributes:
        wall_s: on the clock.
        items_s: of the processor, all items together.
        longest_s: likewise, of the longest item, which no number of processes makes shorter.
    """

    wall_s: float
    items_s: float
    longest_s: float


shared_works: list[SharedWork] = []
"""All loops of this process, which `structlearn.ground.parallel` enters."""


@dataclass(frozen=True)
class StageTime:
    """What one run of a stage took, from the start of Python; by Amdahl's law what more cores would bring.

    On n equal cores it takes the serial part and, loop by loop, an n-th of the items, but no less than the
    longest of them.

    Attributes:
        wall_s: on the clock.
        cpu_s: of the processor, worker processes on this machine included.
        serial_s: on the clock, outside all loops over processes.
        shared_s: of the processor, the items of these loops.
        cores_4_s: on the clock of four cores.
        cores_16_s: likewise.
        cores_64_s: likewise.
    """

    wall_s: float
    cpu_s: float
    serial_s: float
    shared_s: float
    cores_4_s: float
    cores_16_s: float
    cores_64_s: float


def stage_time(wall_s: float, cpu_s: float, works: Sequence[SharedWork]) -> StageTime:
    """Times of a stage from what was measured: the clock, the processor, its loops over processes."""
    serial_s = max(wall_s - sum(work.wall_s for work in works), 0.0)
    shared_s = sum(work.items_s for work in works)
    cores_s = (serial_s + sum(max(work.items_s / n, work.longest_s) for work in works) for n in (4, 16, 64))
    return StageTime(wall_s, cpu_s, serial_s, shared_s, *cores_s)


def timed(main: Callable[[], None]) -> None:
    """Run a stage; if DVC runs it and it ends well, its time is written when the program ends.

    Worker processes end with the program, and the system counts a child's time when it has ended.
    """
    main()
    if RUN_BY_DVC in os.environ:
        # by its command: DVC's name of a stage depends on the folder that DVC is called in
        command, wall_s = shlex.join(sys.argv), _since_start_s()
        atexit.register(lambda: record(command, stage_time(wall_s, _cpu_s(), shared_works)))


def record(command: str, taken: StageTime, path: Path = TIMES) -> None:
    """Enter the time of a stage; a time that cannot be written is told and fails nothing.

    Args:
        command: of the stage, without `python`.
        taken: rounded to 0.1 s.
        path: of the file, which is made anew where it is missing or damaged.
    """
    rounded = StageTime(*(round(value, 1) for value in astuple(taken)))
    times = {**read_times(path), command: rounded}
    entries = {name: asdict(times[name]) for name in sorted(times)}
    try:
        with publish(path) as target:
            target.write_text(json.dumps(entries, indent=2) + "\n")
    except (OSError, InputError) as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


def read_times(path: Path = TIMES) -> dict[str, StageTime]:
    """Times by command; none where the file is missing or damaged."""
    try:
        entries = json.loads(path.read_text())
        return {
            command: StageTime(*(float(entry[field.name]) for field in fields(StageTime)))
            for command, entry in entries.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def _cpu_s() -> float:
    """Of this process and its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def _since_start_s() -> float:
    """On the clock since this process started; where there is no /proc, since this was imported."""
    try:
        started_ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
    except OSError:
        return time.perf_counter() - _IMPORTED_S
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started_ticks / os.sysconf("SC_CLK_TCK")


_IMPORTED_S = time.perf_counter()
