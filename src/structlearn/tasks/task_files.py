"""Paths of the files of one task, and typed readers."""

import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.artefacts import publish, read_csv, read_table
from structlearn.core.errors import InputError
from structlearn.core.params import ParametersType, home_path, read_parameters, value_at
from structlearn.core.stage import run
from structlearn.core.wall_clock import RUN_BY_DVC
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.runs import read_runs
from structlearn.readers.source import ClockParameters
from structlearn.segmentation.segments import Segmentation, read_segmentation

DATA, REPORTS = Path("data/tasks"), Path("reports/tasks")
SKILL, ABSENT, LEFT_OUT = "skill.safetensors", "absent.txt", "left_out.csv"

NAME_RULE = (
    "a task's name has 1 to 60 lower-case letters, digits, - and _, and begins with a letter or a digit"
)
"""It is a folder's, and part of the names of its stages, in which DVC has signs of its own."""

PUBLIC, PUBLIC_FOLDER = "RECORDED_DATA", "data/public"
"""Environment variable with the folder of public sets, `$DATA` in an entry; where it is if there is none."""


def is_name(name: object) -> bool:
    """Whether a task may be called so."""
    return isinstance(name, str) and re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,59}", name) is not None


@dataclass(frozen=True)
class TaskFiles:
    """Outputs of the stages of one task; an InputError where no task may be called so."""

    name: str

    def __post_init__(self) -> None:
        if not is_name(self.name):
            raise InputError(f"{self.name!r}: {NAME_RULE}")

    @property
    def folder(self) -> Path:
        """Of its artefacts."""
        return DATA / self.name

    @property
    def report(self) -> Path:
        """Folder of its page."""
        return REPORTS / self.name

    @property
    def recorded(self) -> Path:
        """Folder of what was recorded, decoded."""
        return self.folder / "recorded"

    @property
    def parameters(self) -> Path:
        """Its kind, its entry with all defaults, and digests of the files that it came from."""
        return self.folder / "parameters.yaml"

    @property
    def kind(self) -> str:
        """Kind of data, a key of `task_entry.KINDS`."""
        return value_at(self.parameters, "kind")

    def entry(self, model: type[ParametersType]) -> ParametersType:
        """All parameters of the task."""
        return read_parameters(self.parameters, "entry", model)

    def part(self, key: str, model: type[ParametersType]) -> ParametersType:
        """Parameters of one part that the task has."""
        return read_parameters(self.parameters, f"entry.{key}", model)

    def has(self, key: str) -> bool:
        """Whether the task has a part, by its key."""
        return value_at(self.parameters, f"entry.{key}") is not None

    def values(self) -> tuple[dict[str, Any], dict[str, dict[str, str]]]:
        """All parameters, and the digests of all files, by what they are for."""
        return value_at(self.parameters, "entry"), value_at(self.parameters, "files")

    @property
    def absent(self) -> str:
        """Why there is nothing of the task: a public set that is not here, or not readable; else empty."""
        path = self.recorded / ABSENT
        return path.read_text(encoding="utf-8").strip() if path.exists() else ""

    def left_out(self) -> pd.DataFrame:
        """`file` and `reason` of recordings that could not be read."""
        return read_csv(self.recorded / LEFT_OUT, keep_default_na=False)

    @property
    def clock(self) -> ClockParameters:
        """On which everything is read."""
        return self.part("clock", ClockParameters)

    def runs(self, kind: str, name: str = "") -> list[Demonstration]:
        """Demonstrations, executions, reaches past obstacles, or corrections in the setting of a name."""
        return read_runs(
            self.recorded / kind / f"{name}.parquet" if name else self.recorded / f"{kind}.parquet"
        )

    def settings(self) -> list[str]:
        """Labels of the settings in which demonstrations were corrected."""
        return sorted(path.stem for path in (self.recorded / "corrections").glob("*.parquet"))

    @property
    def segments(self) -> Path:
        """Folder of the segmentation."""
        return self.folder / "segments"

    def segmentation(self) -> Segmentation:
        """Cuts of the demonstrations."""
        return read_segmentation(self.segments)

    def primitives(self) -> list[PosePrimitive]:
        """In order of time."""
        return read_primitives(self.folder / "primitives/primitives.safetensors")

    @property
    def skill(self) -> Path:
        """All that a robot needs."""
        return self.folder / "skill" / SKILL

    def table(self, name: str) -> pd.DataFrame:
        """A table by its path below the task's folder, without its ending."""
        return read_table(self.folder / f"{name}.parquet")


def leave_out(folder: Path, reason: str) -> None:
    """Make a folder that says why it holds nothing else; about empty ones DVC warns."""
    folder.mkdir()
    (folder / ABSENT).write_text(f"{reason}\n", encoding="utf-8")


def local_path(path: str) -> Path:
    """A path as an entry may have it: from the project's folder, `~` or `$DATA`."""
    if is_public(path):
        return Path(os.environ.get(PUBLIC) or PUBLIC_FOLDER) / path.removeprefix("$DATA").lstrip("/")
    return home_path(path)


def is_public(path: str) -> bool:
    """Whether it lies in the folder of public sets, in which some may be missing."""
    return path.partition("/")[0] == "$DATA"


def run_for_task(main: Callable[[TaskFiles], None], part: str = "", out: str = "") -> None:
    """Run a stage for the task that the command line names, or else DVC.

    Args:
        main: the stage.
        part: key of the task's parameters without which there is nothing to do.
        out: name of the folder that it writes; where there is nothing to do, it says so there.
    """

    def of_task() -> None:
        files = TaskFiles(sys.argv[1] if sys.argv[1:] else _run_for(os.environ.get(RUN_BY_DVC, "")))
        reason = files.absent if out else ""
        if not reason and part and not files.has(part):
            reason = f"The task has no {part}."
        if not reason:
            main(files)
        elif out:
            with publish(files.folder / out) as folder:
                leave_out(folder, reason)

    run(of_task)


def _run_for(stage: str) -> str:
    """The task in the name of a stage as DVC tells it: `stages/tasks/dvc.yaml:segment@pick`."""
    return stage.rpartition("dvc.yaml:")[2].partition("@")[2]
