"""Paths of the files of one task, and typed readers."""

import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import publish, read_csv, read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.params import ParametersType, home_path, read_parameters, value_at
from structlearn.core.stage import RUN_BY_DVC, run
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration, read_runs, read_series
from structlearn.segmentation.segments import Segmentation, read_segmentation

DATA, REPORTS = Path("data/tasks"), Path("reports/tasks")
SKILL, ABSENT, LEFT_OUT = "skill.safetensors", "absent.txt", "left_out.csv"

# A task's name is a folder's, and part of the names of its stages, in which DVC has signs of its own.
NAME_RULE = (
    "a task's name has 1 to 60 lower-case letters, digits, - and _, and begins with a letter or a digit"
)
# Environment variable with the folder of public sets, `$DATA` in an entry; where it is if there is none.
PUBLIC, PUBLIC_FOLDER = "RECORDED_DATA", "data/public"


def is_name(name: object) -> bool:
    """Whether a task may be called so."""
    return isinstance(name, str) and re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,59}", name) is not None


class TaskFiles:
    """Outputs of the stages of one task; an InputError where no task may be called so."""

    def __init__(self, name: str) -> None:
        if not is_name(name):
            raise InputError(f"{name!r}: {NAME_RULE}")
        self.name = name
        self.folder, self.report = DATA / name, REPORTS / name
        self.recorded = self.folder / "recorded"  # what was recorded, decoded
        self.parameters = self.folder / "parameters.yaml"  # see `task_entry.write_task`
        self.segments = self.folder / "segments"
        self.skill = self.folder / "skill" / SKILL  # all that a robot needs

    @property
    def kind(self) -> str:
        """Kind of data, a key of `task_entry.KINDS`."""
        return value_at(self.parameters, "kind")

    def entry(self, model: type[ParametersType], key: str = "") -> ParametersType:
        """All parameters of the task, or those of one part that it has."""
        return read_parameters(self.parameters, f"entry.{key}".rstrip("."), model)

    def has(self, key: str) -> bool:
        """Whether the task has a part, by its key."""
        return value_at(self.parameters, f"entry.{key}") is not None

    @property
    def absent(self) -> str:
        """Why there is nothing of the task: a public set that is not here, or not readable; else empty."""
        path = self.recorded / ABSENT
        return path.read_text(encoding="utf-8").strip() if path.exists() else ""

    def origins(self) -> list[str]:
        """Sources of a public set with their licences."""
        recorded = [one for path in sorted(self.recorded.glob("*.parquet")) for one in read_series(path)]
        known = [one.about.get("provenance", one.about) for one in recorded]
        named = [f"{its['source']} ({its['licence']})" for its in known if "licence" in its]
        return list(dict.fromkeys(named))

    def left_out(self) -> pd.DataFrame:
        """`file` and `reason` of recordings that could not be read."""
        return read_csv(self.recorded / LEFT_OUT, keep_default_na=False)

    def runs(self, kind: str) -> list[Demonstration]:
        """Demonstrations, executions, reaches past obstacles, or `corrections/SETTING`."""
        return read_runs(self.recorded / f"{kind}.parquet")

    def segmentation(self) -> Segmentation:
        """Cuts of the demonstrations."""
        return read_segmentation(self.segments)

    def primitives(self) -> list[PosePrimitive]:
        """In order of time."""
        return read_primitives(self.folder / "primitives/primitives.safetensors")

    def tables(self, part: str) -> dict[str, pd.DataFrame]:
        """All tables of a part, by name."""
        return {path.stem: read_table(path) for path in sorted((self.folder / part).glob("*.parquet"))}

    def table(self, name: str) -> pd.DataFrame:
        """A table by its path below the task's folder, without its ending."""
        return read_table(self.folder / f"{name}.parquet")


def write_tables(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """Write tables as Parquet files by name into a folder."""
    for name, table in tables.items():
        write_table(table, folder / f"{name}.parquet")


def leave_out(folder: Path, reason: str) -> None:
    """Say in a folder why it holds nothing else; about empty ones DVC warns."""
    folder.mkdir(exist_ok=True)
    (folder / ABSENT).write_text(f"{reason}\n", encoding="utf-8")


def local_path(path: str) -> Path:
    """A path as an entry may have it: from the project's folder, `~` or `$DATA`."""
    if is_public(path):
        return Path(os.environ.get(PUBLIC) or PUBLIC_FOLDER) / path.removeprefix("$DATA").lstrip("/")
    return home_path(path)


def is_public(path: str) -> bool:
    """Whether it lies in the folder of public sets, in which some may be missing."""
    return path.partition("/")[0] == "$DATA"


def run_for_task(main: Callable[[TaskFiles], None], out: str = "") -> None:
    """Run a stage for the task that the command line names, or else DVC: `tasks/dvc.yaml:segment@pick`.

    `out`: name of the folder that it writes; where the task is absent, only the reason is written there.
    """

    def of_task() -> None:
        by_dvc = os.environ.get(RUN_BY_DVC, "").rpartition("dvc.yaml:")[2].partition("@")[2]
        files = TaskFiles(sys.argv[1] if sys.argv[1:] else by_dvc)
        if out and files.absent:
            with publish(files.folder / out) as folder:
                leave_out(folder, files.absent)
        else:
            main(files)

    run(of_task)
