"""Files of a project: a folder with tasks, made by `structlearn new`, in which all commands and stages run.

`structlearn.yaml` has the tasks, `dvc.yaml` the stages of the installed package over them. Stages depend on
the package through `.structlearn.yaml`, which has a digest per package folder and is written again before DVC
is called: an update of the package reruns what it touches.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import yaml

from structlearn.core.artefacts import publish

ENTRIES, PIPELINE, CODE = Path("structlearn.yaml"), Path("dvc.yaml"), Path(".structlearn.yaml")
LIBRARY = Path(__file__).parents[1]
STAGES = Path(__file__).with_name("stages")
DEFAULTS = STAGES / "params.yaml"

IGNORED = """\
/data/tasks
/reports/tasks/*/rerun
/reports/times.json
.running-*
__pycache__
"""


def write_project(folder: Path, entries: str, pipeline: str) -> None:
    """Write the files of a project."""
    (folder / ENTRIES).write_text(entries, encoding="utf-8")
    (folder / PIPELINE).write_text(pipeline, encoding="utf-8")
    (folder / ".gitignore").write_text(IGNORED, encoding="utf-8")
    write_code(folder)


def entries_above(path: Path) -> Path | None:
    """The entries of the project that a path is inside of, if any."""
    files = (folder / ENTRIES for folder in path.resolve().parents)
    return next((file for file in files if file.exists()), None)


def packaged_pipeline() -> str:
    """The pipeline of a lab's project."""
    return (STAGES / "pipeline.yaml").read_text(encoding="utf-8")


def write_code(folder: Path = Path()) -> None:
    """Write the digests of the installed package, unless they are there already."""
    text = "# Digests of the installed package, by folder: written by `structlearn run`\n"
    text += yaml.safe_dump(dict(code_digests()), sort_keys=False)
    path = folder / CODE
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        with publish(path) as target:
            target.write_text(text, encoding="utf-8")


def code_digests() -> Iterator[tuple[str, str]]:
    """Name (`code_key`) and digest of each package folder of the library, without its subpackages."""
    files: dict[str, list[Path]] = {}
    for file in sorted(LIBRARY.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts and not file.name.startswith("."):
            if file.parent == STAGES and file.suffix != ".py":
                continue  # defaults reach stages by their task's parameters
            package = next(one for one in file.parents if (one / "__init__.py").exists())
            files.setdefault(code_key(package), []).append(file)
    for key, its in files.items():
        found = hashlib.sha256()
        for file in its:
            found.update(file.relative_to(LIBRARY).as_posix().encode() + b"\0" + file.read_bytes())
        yield key, found.hexdigest()[:16]


def code_key(package: Path) -> str:
    """Name of a package folder of the library, e.g. `core`, `tasks_motion`; `structlearn` for its top."""
    return "_".join(package.relative_to(LIBRARY).parts) or LIBRARY.name
