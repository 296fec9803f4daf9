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
from dataclasses import asdict, dataclass
from pathlib import Path

TIMES = Path("reports/times/stages.json")
"""Relative to the working directory, so an experiment in a directory of its own has times of its own."""

RUN_BY_DVC = "DVC_STAGE"
"""Environment variable that DVC sets while a stage runs."""


@dataclass(frozen=True)
class StageTime:
    """What one run of a stage took, without the start of Python and its imports.

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
    started_s, used_s = time.perf_counter(), _cpu_s()
    main()
    wall_s = time.perf_counter() - started_s
    if RUN_BY_DVC in os.environ:
        import structlearn.ground.artefacts  # noqa: F401 - `record` needs it, and at exit it is too late

        # by its command: DVC's name of a stage depends on the folder that DVC is called in
        command = shlex.join(sys.argv)
        atexit.register(lambda: record(command, StageTime(wall_s, _cpu_s() - used_s)))


def record(command: str, taken: StageTime, path: Path = TIMES) -> None:
    """Enter the time of a stage; a time that cannot be written is told and fails nothing.

    Args:
        command: of the stage, without `python`.
        taken: rounded to 0.1 s.
        path: of the file, which is made anew where it is missing or damaged.
    """
    from structlearn.ground.artefacts import publish

    rounded = StageTime(round(taken.wall_s, 1), round(taken.cpu_s, 1))
    times = {**read_times(path), command: rounded}
    entries = {name: asdict(times[name]) for name in sorted(times)}
    try:
        with publish(path) as target:
            target.write_text(json.dumps(entries, indent=2) + "\n")
    except OSError as error:
        print(f"{path}: the time of {command} is not written: {error}", file=sys.stderr)


def read_times(path: Path = TIMES) -> dict[str, StageTime]:
    """Times by command; none where the file is missing or damaged."""
    try:
        entries = json.loads(path.read_text())
        return {
            command: StageTime(float(entry["wall_s"]), float(entry["cpu_s"]))
            for command, entry in entries.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def _cpu_s() -> float:
    """Of this process and its children that have ended."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system
