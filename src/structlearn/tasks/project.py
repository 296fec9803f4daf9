"""Files of the project in the working directory: a clone of structlearn, or a lab's own folder.

A lab's folder, made by `structlearn new`, has its task entries in `structlearn.yaml` and a `dvc.yaml` that
runs the stages of the installed package; defaults come from the package. In a clone these files are in
`stages/tasks`, which is the folder `stages` of this package.
"""

import re
from pathlib import Path
from typing import Any

from structlearn.core.errors import InputError
from structlearn.core.params import read_values

PACKAGE = "structlearn.tasks"
LAB = Path("structlearn.yaml")
CLONE = Path("stages/tasks")
PACKAGED = Path(__file__).parent / "stages"
DEFAULTS, OWN, OF_PUBLIC = "params.yaml", "own.yaml", "public.yaml"
CODE = "data/code/tasks"

# Stages that need the simulated testbeds or a clone's sources
FOR_CLONES = ("code", "calibrate", "calibration_report", "recorded_report")


def is_lab() -> bool:
    """Whether the working directory is a lab's folder."""
    return LAB.exists()


def entries_above(path: Path) -> Path | None:
    """The user's entries of the project that a path is inside of, if any."""
    files = (folder / file for folder in path.resolve().parents for file in (LAB, CLONE / OWN))
    return next((file for file in files if file.exists()), None)


def folder() -> Path:
    """Folder of the tasks' pipeline. Raises InputError: the working directory is no project."""
    if not is_lab() and not CLONE.is_dir():
        raise InputError(f"{LAB}: no such file here; `structlearn new` makes a project")
    return Path() if is_lab() else CLONE


def entry_files(clone: Path | None = None) -> tuple[Path, ...]:
    """Files with task entries, of this project or of a clone's folder; the last one is the user's."""
    if clone is None and is_lab():
        return (LAB,)
    clone = clone or folder()
    return clone / OF_PUBLIC, clone / OWN


def defaults_file(clone: Path | None = None) -> Path:
    """File with the defaults of all kinds of data: the package's, or a clone's own."""
    return (PACKAGED if clone is None and (is_lab() or not CLONE.is_dir()) else clone or CLONE) / DEFAULTS


def pipeline() -> str:
    """Path of the tasks' pipeline, as in DVC's stage addresses."""
    return (folder() / "dvc.yaml").as_posix()


def lab_pipeline() -> dict[str, Any]:
    """Contents of a lab's `dvc.yaml`: a clone's stages, run from the package.

    As in a clone, a stage depends on its code through the list written by `code`. Kinds without entries are
    empty.
    """
    stages = read_values(PACKAGED / "dvc.yaml")["stages"].items()
    packaged = {name: _from_package(stage) for name, stage in stages if name not in FOR_CLONES}
    code = {"cmd": f"python -m {__name__}", "always_changed": True, "outs": [CODE]}
    kinds: dict[str, Any] = {stage["foreach"].strip("${}"): {} for stage in packaged.values()}
    return {"vars": [kinds, LAB.as_posix()], "stages": {"code": code} | packaged}


def _from_package(stage: dict[str, Any]) -> dict[str, Any]:
    """Convert a stage over the tasks of a kind, dropping what only a clone has."""
    body = {key: value for key, value in stage["do"].items() if key != "wdir"}
    body["cmd"] = re.sub(r"^python stages/tasks/(\w+)\.py", rf"python -m {PACKAGE}.stages.\1", body["cmd"])
    body["deps"] = [path for path in body["deps"] if not path.startswith(CLONE.as_posix())]
    if "params" in body:
        body["params"] = [one for one in body["params"] if isinstance(one, dict)]
    return {"foreach": stage["foreach"], "do": body}
