"""Paths of the files of one task, and typed readers."""

import os
import re
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import pandas as pd
import yaml

from structlearn.core.artefacts import publish, read_csv, read_table, write_table
from structlearn.core.errors import InputError
from structlearn.core.params import ParametersType, home_path, read_parameters, value_at
from structlearn.core.stage import RUN_BY_DVC, run
from structlearn.primitives.primitive_files import read_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration, read_about, read_runs
from structlearn.segmentation.segments import Segmentation, read_segmentation

DATA, REPORTS = Path("data/tasks"), Path("reports/tasks")
SKILL, ABSENT, LEFT_OUT = "skill.safetensors", "absent.txt", "left_out.csv"

# Task names are used for folders and in stage names, where DVC gives some characters a meaning
NAME_RULE = (
    "a task's name has 1 to 60 lower-case letters, digits, - and _, begins with a letter or a digit, "
    "and is not what YAML reads as a number, a date, yes, no or null"
)
# Numbers of YAML 1.2, in which DVC reads entries, that are text in YAML 1.1
NUMBER = re.compile(r"[0-9][0-9_]*e-?[0-9]+|0o[0-7_]+")
# Environment variable with the folder of public sets (`$DATA` in entries), and its default
PUBLIC, PUBLIC_FOLDER = "RECORDED_DATA", "data/public"


def is_name(name: object) -> bool:
    """Whether a task may have this name."""
    if not isinstance(name, str) or not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,59}", name):
        return False
    tag = yaml.SafeLoader("").resolve(yaml.ScalarNode, name, (True, False))
    return tag == "tag:yaml.org,2002:str" and not NUMBER.fullmatch(name)


class TaskFiles:
    """Files of one task's stages. Raises InputError: the name is invalid."""

    def __init__(self, name: str) -> None:
        if not is_name(name):
            raise InputError(f"{name!r}: {NAME_RULE}")
        self.name = name
        self.folder, self.report = DATA / name, REPORTS / name
        self.recorded = self.folder / "recorded"  # decoded recordings
        self.parameters = self.folder / "parameters.yaml"  # see `task_entry.write_task`
        self.segments = self.folder / "segments"
        self.skill = self.folder / "skill" / SKILL  # all that a robot needs

    @property
    def kind(self) -> str:
        """Kind of data, see `kinds`."""
        return value_at(self.parameters, "kind")

    @property
    def learned(self) -> Path:
        """What was learned, for kinds with a single stage for it, named by the kind."""
        return self.folder / self.kind.rpartition(".")[2]

    def entry(self, model: type[ParametersType], key: str = "") -> ParametersType:
        """Parameters of the task, or of one of its parts."""
        return read_parameters(self.parameters, f"entry.{key}".rstrip("."), model)

    def has(self, key: str) -> bool:
        """Whether the task has a part."""
        return value_at(self.parameters, f"entry.{key}") is not None

    @property
    def absent(self) -> str:
        """Reason if a public set is not here or not readable; otherwise empty."""
        path = self.recorded / ABSENT
        return path.read_text(encoding="utf-8").strip() if path.exists() else ""

    def origins(self) -> list[str]:
        """Sources of a public set, with their licences."""
        paths = sorted(self.recorded.glob("*.parquet"))
        known = [about.get("provenance", about) for path in paths for about in read_about(path).values()]
        named = [f"{about['source']} ({about['licence']})" for about in known if "licence" in about]
        return list(dict.fromkeys(named))

    def left_out(self) -> pd.DataFrame:
        """`file` and `reason` of recordings that could not be read."""
        return read_csv(self.recorded / LEFT_OUT, keep_default_na=False)

    def runs(self, kind: str, signals: Collection[str] | None = None) -> list[Demonstration]:
        """Runs of one kind (demonstrations, executions, reaches, or `corrections/SETTING`): `read_runs`."""
        return read_runs(self.recorded / f"{kind}.parquet", signals)

    def segmentation(self) -> Segmentation:
        """Cuts of the demonstrations."""
        return read_segmentation(self.segments)

    def primitives(self) -> list[PosePrimitive]:
        """Primitives in temporal order."""
        return read_primitives(self.folder / "primitives/primitives.safetensors")

    def tables(self, part: str) -> dict[str, pd.DataFrame]:
        """All tables of a part, keyed by name."""
        return {path.stem: read_table(path) for path in sorted((self.folder / part).glob("*.parquet"))}

    def table(self, name: str) -> pd.DataFrame:
        """Read a table by its path in the task's folder, without suffix."""
        return read_table(self.folder / f"{name}.parquet")


def write_tables(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """Write tables to `NAME.parquet` in a folder."""
    for name, table in tables.items():
        write_table(table, folder / f"{name}.parquet")


def leave_out(folder: Path, reason: str) -> None:
    """Write to a folder why it holds nothing else; DVC warns about empty folders."""
    folder.mkdir(exist_ok=True)
    (folder / ABSENT).write_text(f"{reason}\n", encoding="utf-8")


def local_path(path: str) -> Path:
    """Resolve a path from an entry: relative to the project's folder, `~` or `$DATA`."""
    if is_public(path):
        return Path(os.environ.get(PUBLIC) or PUBLIC_FOLDER) / path.removeprefix("$DATA").lstrip("/")
    return home_path(path)


def is_public(path: str) -> bool:
    """Whether a path is in the folder of public sets, some of which may be missing."""
    return path.partition("/")[0] == "$DATA"


def run_for_task(main: Callable[[TaskFiles], None], out: str = "") -> None:
    """Run a stage for the task named by the command line, or else by DVC: `segment@pick`.

    `out`: name of the folder that it writes; if the task is absent, only the reason is written there.
    """

    def of_task() -> None:
        by_dvc = os.environ.get(RUN_BY_DVC, "").partition("@")[2]
        files = TaskFiles(sys.argv[1] if sys.argv[1:] else by_dvc)
        if out and files.absent:
            with publish(files.folder / out) as folder:
                leave_out(folder, files.absent)
        else:
            main(files)

    run(of_task)
