"""Files of a project: a folder with tasks, made by `structlearn new`, in which all commands and stages run.

`structlearn.yaml` has the tasks, `dvc.yaml` the stages of the installed package over them. Stages depend on
the package through `.structlearn.yaml`, which has a digest per package folder and is written again before DVC
is called: an update of the package reruns what it touches.
"""

from importlib.util import find_spec
from pathlib import Path

from structlearn.core.code_digests import LIBRARY, write_code
from structlearn.core.params import read_values

ENTRIES, PIPELINE = Path("structlearn.yaml"), Path("dvc.yaml")
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
    update_code(folder)


def entries_above(path: Path) -> Path | None:
    """The entries of the project that a path is inside of, if any."""
    files = (folder / ENTRIES for folder in path.resolve().parents)
    return next((file for file in files if file.exists()), None)


def packaged_pipeline() -> str:
    """The pipeline of a lab's project."""
    return (STAGES / "pipeline.yaml").read_text(encoding="utf-8")


def update_code(folder: Path = Path()) -> None:
    """Write the digests of this package and of those that a project's entries name."""
    write_code(folder, named_packages(folder))


def named_packages(folder: Path) -> list[Path]:
    """Folders of this package, and of those whose kinds of data or readers a project's entries name."""
    names: set[str] = set()
    kinds = read_values(folder / ENTRIES) if (folder / ENTRIES).exists() else {}
    for kind, tasks in kinds.items() if isinstance(kinds, dict) else ():
        entries = tasks.values() if isinstance(tasks, dict) else ()
        readers = [entry.get("reader") for entry in entries if isinstance(entry, dict)]
        names |= {str(name).partition(".")[0] for name in (kind, *readers) if "." in str(name)}
    specs = [find_spec(name) for name in sorted(names)]
    locations = [
        spec.submodule_search_locations for spec in specs if spec and spec.submodule_search_locations
    ]
    return [LIBRARY, *(Path(folders[0]) for folders in locations)]
