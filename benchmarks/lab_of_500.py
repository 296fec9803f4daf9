"""A lab of 500 demonstrations of a minute at 1 kHz: from bags to a checked skill by the README's commands.

    python benchmarks/lab_of_500.py FOLDER [--count 500] [--seconds 60] [--rate 1000] [--output table.csv]

The bags are made up (`made_up_lab`) and kept in FOLDER/bags, about 20 MB each; the project is FOLDER/lab.
Printed are minutes by the wall clock, of processors, and the peak of memory of each step with its processes;
what they share counts once.
"""

import argparse
import shutil
import subprocess
import sys
import threading
import time
from collections import defaultdict
from pathlib import Path

import pandas as pd
import psutil
import yaml
from made_up_lab import FINGERS, write_lab
from timing import at_least_one, machine

from dissertation.simulation.pick_and_place import TIP, URDF
from structlearn.core.artefacts import write_csv
from structlearn.core.stage import read_times

STAGES = "structlearn.tasks.stages."
ROBOT = {"urdf": URDF, "tip": TIP, "locked_joints": FINGERS}
SAMPLED_S = 0.5


def main() -> None:
    """Write the bags, then run every command and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="for bags and project; the project is made anew")
    parser.add_argument("--count", type=at_least_one, default=500, help="demonstrations")
    parser.add_argument("--seconds", type=float, default=60.0, help="duration of each")
    parser.add_argument(
        "--rate", type=float, default=1000.0, help="Hz, of all topics and of the task's clock"
    )
    parser.add_argument("--output", type=Path, help="write the rows to this CSV file too")
    given = parser.parse_args()
    bags, project = given.folder.resolve() / "bags", given.folder.resolve() / "lab"
    if project.exists():
        shutil.rmtree(project)
    begin = time.perf_counter()
    write_lab(bags, given.count, given.seconds, given.rate)
    written_s = time.perf_counter() - begin
    rows = command("new", "lab", "--from", str(bags), folder=given.folder)
    complete_entry(project / "structlearn.yaml", given.rate)
    rows += command("run", folder=project) + command("check", "lab", folder=project)
    table = pd.DataFrame(rows)
    size_gb = sum(path.stat().st_size for path in bags.glob("*.mcap")) / 1e9
    print(machine())
    print(f"{given.count} demonstrations of {given.seconds:g} s at {given.rate:g} Hz, {size_gb:.2f} GB")
    print(f"written in {written_s / 60:.1f} minutes, which is not part of what follows")
    print(table.to_string(index=False, float_format="{:.2f}".format))
    if given.output:
        write_csv(table, given.output)


def complete_entry(path: Path, rate_hz: float) -> None:
    """Add to the proposed entry what a lab adds: its robot, and the clock's rate."""
    entries = yaml.safe_load(path.read_text())
    entries["movement"]["lab"] |= {"robot": ROBOT, "clock": {"rate_hz": rate_hz}}
    path.write_text(yaml.safe_dump(entries, sort_keys=False))
    print(path.read_text())


def command(*words: str, folder: Path) -> list[dict[str, object]]:
    """Run a command; rows of its stages, if it has run any, and of the whole."""
    begin, before = time.perf_counter(), read_times(folder / "reports/times.json")
    running = subprocess.Popen([sys.executable, "-m", "structlearn", *words], cwd=folder)
    peaks, ended = defaultdict[str, float](float), threading.Event()
    watch = threading.Thread(target=_watch, args=(running.pid, peaks, ended))
    watch.start()
    code = running.wait()
    ended.set()
    watch.join()
    minutes = (time.perf_counter() - begin) / 60
    if code and words[0] != "check":  # whose code 1 is the verdict "no"
        raise SystemExit(f"structlearn {' '.join(words)}: ended with code {code}")
    rows = []
    for name, taken in read_times(folder / "reports/times.json").items():
        stage = Path(name.split()[0]).stem
        if before.get(name) != taken:
            cpu = taken.cpu_s / 60
            rows.append(
                {"step": stage, "minutes": taken.wall_s / 60, "cpu_minutes": cpu, "peak_mb": peaks[stage]}
            )
    rows.sort(key=lambda row: list(peaks).index(row["step"]))  # in the order in which they were seen
    return [*rows, {"step": f"structlearn {words[0]}", "minutes": minutes, "peak_mb": max(peaks.values())}]


def _watch(command: int, peaks: dict[str, float], ended: threading.Event) -> None:
    """Note the largest memory in MB of each stage's processes, and of a command's others."""
    while not ended.wait(SAMPLED_S):
        now = defaultdict[str, float](float)
        for process in _family(command):
            try:
                stage = next((word for word in process.cmdline() if word.startswith(STAGES)), STAGES)
                now[stage.removeprefix(STAGES)] += _proportional_mb(process.pid)
            except (psutil.Error, OSError):  # has ended meanwhile
                continue
        for stage, memory in now.items():
            peaks[stage] = max(peaks[stage], memory)


def _family(command: int) -> list[psutil.Process]:
    try:
        top = psutil.Process(command)
        return [top, *top.children(recursive=True)]
    except psutil.Error:
        return []


def _proportional_mb(process: int) -> float:
    """Resident memory of a process, in which shared pages count by their share."""
    for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024
    return 0.0


if __name__ == "__main__":
    main()
