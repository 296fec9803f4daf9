"""The project of public sets, `data/recorded`: a lab's project with pages of our own and further stages.

Sets are the entries of `public.yaml`; `pipeline.yaml` has the stages that only this project has.
"""

import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from structlearn.core import code_digests
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.core.stage import run
from structlearn.tasks import project
from structlearn.tasks.task_entry import read_entries
from structlearn.tasks.task_files import local_path

FOLDER = Path("data/recorded")
SETS, STAGES = (Path(__file__).with_name(name) for name in ("public.yaml", "pipeline.yaml"))
CODE = code_digests.CODE.name  # a stage's parameters in it are the code that it uses
HEADER = "# Written by `python -m dissertation.recorded.sets_project`.\n"


def main() -> None:
    """Write the project. Raises InputError: there is no public set."""
    if not any(local_path(str(one.values.get("source"))).exists() for one in read_entries(SETS).values()):
        folder = local_path("$DATA")
        raise InputError(f"{folder}: holds no public set; name their folder: make recorded DATA=FOLDER")
    FOLDER.mkdir(parents=True, exist_ok=True)
    text = HEADER + yaml.safe_dump(pipeline(), sort_keys=False)
    project.write_project(FOLDER, SETS.read_text(encoding="utf-8"), text)
    if not (FOLDER / ".dvc").exists():
        command = [str(Path(sys.executable).with_name("dvc")), "init", "--quiet", "--no-scm"]
        subprocess.run(command, cwd=FOLDER, check=True)


def pipeline() -> dict[str, Any]:
    """Stages of a lab's project, with our own pages, and our own stages."""
    found = yaml.safe_load(project.packaged_pipeline())
    own = read_values(STAGES)
    for name, stage in found["stages"].items():
        if name.startswith("report_"):
            stage["do"]["cmd"] = own["page"]["cmd"]
            stage["do"]["deps"] += own["page"]["deps"]
            used = next(one[CODE] for one in stage["do"]["params"] if CODE in one)
            used += own["page"]["code"]
    return found | {"stages": found["stages"] | own["stages"]}


if __name__ == "__main__":
    run(main, stage=False)
