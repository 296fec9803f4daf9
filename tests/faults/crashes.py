"""End a process before any one of its steps on the disk, and lose what it had not brought there.

A step is whatever changes a folder, opens a file to be written or brings something to the disk. The process
ends before the step; files that were written and not brought to the disk keep a part of their content, zeros,
or all of it, as a power cut leaves them. Folders change in the order of the steps, as in file systems with a
journal, so that a change of a folder which is lost is a process that ended earlier.
"""

import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import write_csv, write_table, write_tensors
from structlearn.core.publication import publish
from structlearn.core.stage import TIMES, StageTime, record

ENDED = 9
"""Exit code of a process that ended before its step."""

OF_FOLDERS = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate")

Tree = Mapping[str, bytes | None]
"""Files and folders by their path, the content of a folder None."""


@dataclass(frozen=True)
class Work:
    """What a process writes in a folder, where `before` has written.

    Paths that are `whole` are at any time as before or as after or, where they are folders, not there.
    """

    before: Callable[[Path], None]
    write: Callable[[Path], None]
    whole: tuple[str, ...]


def outcomes(work: Work, root: Path, seed: int) -> Iterator[tuple[int, str | None]]:
    """For each step of a work, what is wrong after it ended there and was done again; None: nothing."""
    work.before(root)
    before = tree(root)
    work.write(root)
    after = tree(root)
    step = 0
    while True:
        shutil.rmtree(root)
        root.mkdir()
        work.before(root)
        if not _ended_before(step, work.write, root, seed):
            return
        left = tree(root)
        fault = next((path for path in work.whole if not _is_whole(path, left, before, after)), None)
        if fault is not None:
            yield step, f"{fault} is neither as before nor as after"
        else:
            work.write(root)
            again = tree(root)
            changed = sorted(path for path in {*again, *after} if again.get(path, "") != after.get(path, ""))
            yield step, f"done again, other than without the crash: {changed[0]}" if changed else None
        step += 1


def tree(root: Path) -> Tree:
    """All that is in a folder, hidden things too."""
    return {
        path.relative_to(root).as_posix(): None if path.is_dir() else path.read_bytes()
        for path in sorted(root.rglob("*"))
    }


def _is_whole(path: str, left: Tree, before: Tree, after: Tree) -> bool:
    found, *known = (
        {name: its for name, its in one.items() if _below(name, path)} for one in (left, before, after)
    )
    gone = not found and before.get(path, b"") is None  # a folder is moved aside before the new one comes
    return found in known or gone


def _below(name: str, path: str) -> bool:
    return name == path or name.startswith(f"{path}/")


def _ended_before(step: int, write: Callable[[Path], None], root: Path, seed: int) -> bool:
    """Do a work in a process that ends before a step; False if it has fewer."""
    child = os.fork()
    if not child:
        try:
            take_step = _end_before(step, root, np.random.default_rng((seed, step)))
            write(root)
            take_step()  # the power may fail as soon as it says that it is done
            os._exit(0)
        finally:
            os._exit(1)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code not in (0, ENDED):
        raise RuntimeError(f"the work fails before step {step}")
    return code == ENDED


def _end_before(step: int, root: Path, rng: np.random.Generator) -> Callable[[], None]:
    """In a process of its own: let it end before a step; what is returned is one more."""
    on_disk = {_state(path) for path in root.rglob("*") if path.is_file()}
    fsync, done = os.fsync, 0

    def take_step(_: str = "") -> None:
        nonlocal done
        done += 1  # first: losing takes steps too
        if done == step + 1:
            _lose(root, on_disk, rng)
            os._exit(ENDED)

    def bring(file: int) -> None:
        take_step()
        fsync(file)
        on_disk.add(_state(file))

    def watch(event: str, arguments: tuple) -> None:
        written = (
            event == "open" and isinstance(arguments[2], int) and arguments[2] & (os.O_WRONLY | os.O_RDWR)
        )
        if event in OF_FOLDERS or (written and str(arguments[0]).startswith(str(root))):
            take_step()

    os.fsync = bring
    sys.addaudithook(watch)
    return take_step


def _state(file: Path | int) -> tuple[int, int, int]:
    state = os.stat(file)
    return state.st_ino, state.st_mtime_ns, state.st_size


def _lose(root: Path, on_disk: set, rng: np.random.Generator) -> None:
    """Files that were not brought to the disk keep all, a part, or zeros in its place."""
    for path in sorted(path for path in root.rglob("*") if path.is_file() and _state(path) not in on_disk):
        size = path.stat().st_size
        kept = int(rng.integers(size + 1))
        fate = rng.integers(3)
        if fate < 2:
            os.truncate(path, kept)
        if fate == 1:
            os.truncate(path, size)  # the rest are zeros


def _folder(root: Path, name: str) -> None:
    with publish(root / "logs") as path:
        (path / "deep").mkdir(parents=True)
        (path / name).write_text(name)
        (path / "deep/table.csv").write_text("a,b\n" * 100)


def _file(root: Path, text: str) -> None:
    with publish(root / "note.txt") as path:
        path.write_text(text * 1000)


def _times(root: Path, seconds: float) -> None:
    for command in ("stages/a.py", "stages/b.py"):
        record(command, StageTime(seconds, seconds), root / TIMES)


def _tables(root: Path, factor: float) -> None:
    values = factor * np.arange(2000.0)
    write_table(pd.DataFrame({"value": values}), root / "table.parquet")
    write_csv(pd.DataFrame({"value": values}), root / "table.csv")
    write_tensors({"values": values}, root / "values.safetensors", "test")


def _twice(write: Callable[[Path, Any], None], first: Any, second: Any, *whole: str) -> Work:
    """A second version over a first."""
    return Work(lambda root: write(root, first), lambda root: write(root, second), whole)


FIRST, SECOND = "first ", "second "

WORKS = {
    "a new file": Work(lambda root: None, lambda root: _file(root, FIRST), ("note.txt",)),
    "a file over another": _twice(_file, FIRST, SECOND, "note.txt"),
    "a new folder": Work(lambda root: None, lambda root: _folder(root, FIRST), ("logs",)),
    "a folder over another": _twice(_folder, FIRST, SECOND, "logs"),
    "tables and arrays": _twice(_tables, 1.0, 2.0, "table.parquet", "table.csv", "values.safetensors"),
    "times of stages": _twice(_times, 1.0, 2.0),
}
"""By name; of two times, which are entered one after the other, a crash may leave one."""
