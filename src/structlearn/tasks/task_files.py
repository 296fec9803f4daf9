"""Paths of the files of one task of your own, and typed readers."""

import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.artefacts import publish, read_table
from structlearn.core.errors import InputError
from structlearn.core.params import ParametersType, read_parameters, read_values, value_at
from structlearn.core.stage import run
from structlearn.core.wall_clock import RUN_BY_DVC
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.clock import ClockParameters
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.runs import read_runs
from structlearn.segmentation.segments import Segmentation, read_segmentation

DATA, REPORTS = Path("data/own"), Path("reports/own")
SKILL, ABSENT, RUNS = "skill.safetensors", "absent.txt", "runs"

NAME_RULE = "a task's name has letters, digits, - and _ alone, and begins with a letter or a digit"
"""It is a folder's, and part of the names of its stages, in which DVC has signs of its own."""


def is_name(name: str) -> bool:
    """Whether a task may be called so."""
    return re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name) is not None


@dataclass(frozen=True)
class TaskFiles:
    """Outputs of the stages of one task.

    Attributes:
        name: of the task.

    Raises:
        InputError: no task may be called so.
    """

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
    def parameters(self) -> Path:
        """Its parameters with all defaults, and the digests of the files that it came from."""
        return self.folder / "parameters.yaml"

    def part(self, key: str, model: type[ParametersType]) -> ParametersType:
        """Parameters of one part that the task has."""
        return read_parameters(self.parameters, key, model)

    def has(self, key: str) -> bool:
        """Whether the task has a part, by its key."""
        return value_at(self.parameters, key) is not None

    def values(self) -> tuple[dict[str, Any], dict[str, dict[str, str]]]:
        """All parameters, and the digests of all files, by what they are for."""
        files = value_at(self.parameters, "files")
        values = read_values(self.parameters).items()
        return {key: value for key, value in values if key != "files"}, files

    @property
    def clock(self) -> ClockParameters:
        """On which everything is read."""
        return self.part("clock", ClockParameters)

    def runs(self, kind: str, name: str = RUNS) -> list[Demonstration]:
        """Demonstrations, executions, reaches past obstacles, or corrections in the setting of a name."""
        return read_runs(self.folder / kind / f"{name}.parquet")

    def settings(self) -> list[str]:
        """Labels of the settings in which demonstrations were corrected."""
        return sorted(path.stem for path in (self.folder / "corrections").glob("*.parquet"))

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
        return self.folder / SKILL

    def table(self, name: str) -> pd.DataFrame:
        """A table by its path below the task's folder, without its ending."""
        return read_table(self.folder / f"{name}.parquet")


def leave_out(folder: Path, part: str) -> None:
    """Make a folder that says that the task has no such part; about empty ones DVC warns."""
    folder.mkdir()
    (folder / ABSENT).write_text(f"The task has no {part}.\n", encoding="utf-8")


def run_for_task(main: Callable[[TaskFiles], None], part: str = "", out: str = "") -> None:
    """Run a stage for the task that the command line names, or else DVC.

    Args:
        main: the stage.
        part: key of the part that it is for.
        out: name of the folder that it writes; where the task has no such part, it says so there.
    """

    def of_task() -> None:
        files = TaskFiles(sys.argv[1] if sys.argv[1:] else _run_for(os.environ.get(RUN_BY_DVC, "")))
        if not part or files.has(part):
            main(files)
        elif out:
            with publish(files.folder / out) as folder:
                leave_out(folder, part)

    run(of_task)


def _run_for(stage: str) -> str:
    """The task in the name of a stage as DVC tells it, e.g. `stages/own/dvc.yaml:segment@pick`."""
    return stage.partition("dvc.yaml:")[2].partition("@")[2]
