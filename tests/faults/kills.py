"""Kill stages of the pipeline while they run, and do them again: `make kills N=50`.

On a copy of the reduced pipeline, which is built once for the present code, every stage is killed in its turn
at a share of the time that it takes: with all its processes or alone, as for want of memory, with its former
outputs in place or removed as DVC does. Nobody may live on, nothing may stay in shared memory, and the stage
done again leaves the tree that it leaves without a kill. Before that come the crash points of `crashes`.

Writes `reports/reliability`; names each case that breaks the rule.
"""

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from faults.crashes import WORKS, outcomes
from faults.reliability import keep, outcome_table
from reduced_pipeline import artefacts, clone, environment
from tqdm import tqdm

from structlearn.core.parallel import PROCESSES
from structlearn.core.stage import RUN_BY_DVC, TIMES, read_times

HEALED, NOT_KILLED = "healed", "ended before the kill"
LIVES_ON, IN_MEMORY, FAILS = "processes live on", "shared memory stays", "fails when done again"
DIFFERS = "leaves other files"
OUTCOMES = (HEALED, NOT_KILLED, LIVES_ON, IN_MEMORY, FAILS, DIFFERS)

POINTS = "crash points"

GROUP, ALONE = "all processes", "the parent alone"

SHARES = (0.02, 0.8)  # of a stage's time at which it is killed; some runs are faster than the first
END_S = 5.0  # processes see within half a second that their parent is gone
SHARED = Path("/dev/shm")
ROOT = Path(__file__).parents[2]


def main() -> None:
    """Crash, kill, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=50, help="kills in all")
    parser.add_argument("--seed", type=int, default=0, help="of when and how; and of what a crash loses")
    given = parser.parse_args()
    made = f"make kills N={given.count}"
    with tempfile.TemporaryDirectory() as folder:
        crashed, broken = crash_points(Path(folder), given.seed)
        keep("crashes", crashed, made, {"points": int(crashed[POINTS].sum()), "broken": len(broken)})
        project = Path(folder, "project")
        shutil.copytree(built(ROOT / ".dvc/tmp"), project, symlinks=True)
        killed, more = kills(project, given.count, given.seed)
    counts = killed[list(OUTCOMES)].sum()
    metrics = {
        "stages": int(counts.sum()),
        "healed": int(counts[HEALED]),
        "ended_before": int(counts[NOT_KILLED]),
    }
    keep("kills", killed, made, metrics | {"broken": len(more)})
    print(crashed.to_string(index=False), killed.to_string(index=False), sep="\n\n")
    if broken + more:
        sys.exit("\n".join(["error: the rule is broken:", *broken, *more]))


def crash_points(folder: Path, seed: int) -> tuple[pd.DataFrame, list[str]]:
    """How many crash points of each work heal, and those that do not."""
    rows, broken = [], []
    for name, work in WORKS.items():
        root = folder / "crashes" / name
        root.mkdir(parents=True)
        faults = dict(outcomes(work, root, seed))
        rows.append((name, len(faults), sum(fault is None for fault in faults.values())))
        broken += [f"{name}, step {step}: {fault}" for step, fault in faults.items() if fault is not None]
    return pd.DataFrame(rows, columns=["work", POINTS, HEALED]), broken


def built(folder: Path) -> Path:
    """The reduced pipeline of the present code, stage by stage, each in a process whose time is taken."""
    files = [ROOT / "params.yaml", *sorted(ROOT.glob("src/**/*.py")), *sorted(ROOT.glob("stages/**/*.py"))]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    project = folder / f"reduced-{digest[:16]}"
    if not project.exists():
        project.mkdir(parents=True)
        clone(ROOT, project)
        (project / TIMES).unlink(missing_ok=True)
    times = read_times(project / TIMES)
    missing = [stage for stage in pipeline(project).values() if _entry(stage) not in times]
    for stage in tqdm(missing, desc="the reduced pipeline", leave=False, disable=None):
        with started(project, stage["cmd"]) as process:
            words = process.communicate()[1]
        if process.returncode:
            sys.exit(f"{stage['cmd']}: {words.decode()}")
    return project


def pipeline(project: Path) -> Mapping[str, Mapping]:
    """Stages of a project by name."""
    return yaml.load((project / "dvc.yaml").read_text(), yaml.CSafeLoader)["stages"]


def _entry(stage: Mapping) -> str:
    """Of a stage among the times."""
    return stage["cmd"].removeprefix("python ")


def kills(project: Path, count: int, seed: int) -> tuple[pd.DataFrame, list[str]]:
    """Kill stages of a project that were done, one after the other; the project stays as it is."""
    rng = np.random.default_rng(seed)
    done = read_times(project / TIMES)
    stages = {name: stage for name, stage in pipeline(project).items() if _entry(stage) in done}
    before = artefacts(project)
    found, broken = Counter(), []
    order: list[str] = []
    for number in tqdm(range(count), leave=False, disable=None):
        order = order or rng.permutation(list(stages)).tolist()
        name = order.pop()
        command = stages[name]["cmd"]
        due_s = rng.uniform(*SHARES) * done[_entry(stages[name])].wall_s
        alone, removed = bool(rng.integers(2)), bool(rng.integers(2))
        if removed:
            remove_outputs(project, stages[name])
        outcome, words = healed(project, command, due_s, lambda: False, alone)
        if outcome == HEALED:
            after = artefacts(project)
            changed = sorted(path for path in {*before, *after} if before.get(path) != after.get(path))
            if changed:
                outcome, words = DIFFERS, ", ".join(changed[:5])
        found[name, ALONE if alone else GROUP, "removed" if removed else "in place", outcome] += 1
        if outcome not in (HEALED, NOT_KILLED):
            broken.append(f"kill {number}: {name} after {due_s:.2f} s: {outcome}: {words}")
    rows = [(*key, its) for key, its in sorted(found.items())]
    return outcome_table(rows, ["stage", "killed", "outputs"], OUTCOMES), broken


def healed(
    project: Path, command: str, after_s: float, due: Callable[[], bool], alone: bool
) -> tuple[str, str]:
    """Kill a stage of a finished project when `due`, `alone` or with all its processes, and do it again."""
    shared = set(SHARED.iterdir())
    with started(project, command, subprocess.DEVNULL) as process:
        begin = time.monotonic()
        while process.poll() is None and not due() and time.monotonic() - begin < after_s:
            time.sleep(0.005)
        ended = process.poll() is not None
        if not ended:
            (os.kill if alone else os.killpg)(process.pid, signal.SIGKILL)
    ends = time.monotonic() + END_S
    while (left := members(process.pid)) and time.monotonic() < ends:
        time.sleep(0.05)
    for number in left:
        os.kill(number, signal.SIGKILL)
    if left:
        return LIVES_ON, f"{len(left)} processes"
    if stays := sorted(path.name for path in set(SHARED.iterdir()) - shared if not _in_use(path)):
        return IN_MEMORY, ", ".join(stays)
    with started(project, command) as process:
        words = process.communicate()[1].decode()
    if process.returncode:
        return FAILS, words.strip().splitlines()[-1]
    return (NOT_KILLED if ended else HEALED), ""


def started(project: Path, command: str, errors: int = subprocess.PIPE) -> subprocess.Popen:
    """A stage as DVC starts it, two processes at a time, in a session of its own."""
    variables = environment() | {RUN_BY_DVC: "stage", PROCESSES: "2"}
    words = [sys.executable, *command.split()[1:]]
    return subprocess.Popen(
        words, cwd=project, env=variables, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True
    )


def members(session: int) -> list[int]:
    """Processes of a session that live."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:  # it has ended meanwhile
            continue
        if int(its) == session and state != "Z":
            found.append(int(folder.name))
    return found


def remove_outputs(project: Path, stage: Mapping) -> None:
    """As DVC does before it runs a stage."""
    for out in [*stage.get("outs", ()), *stage.get("metrics", ())]:
        path, options = (out, {}) if isinstance(out, str) else next(iter(out.items()))
        if not options.get("persist"):
            subprocess.run(["rm", "-rf", "--", path], cwd=project, check=True)


def _in_use(path: Path) -> bool:
    """Whether it is gone, or some process that lives has it open."""
    if not path.exists():
        return True
    for maps in Path("/proc").glob("[0-9]*/maps"):
        try:
            if str(path) in maps.read_text():
                return True
        except OSError:  # it has ended meanwhile, or is another user's
            continue
    return False


if __name__ == "__main__":
    main()
