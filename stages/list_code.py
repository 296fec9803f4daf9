"""List the code that each stage of a pipeline uses, with digests, so that an edit reruns only its users.

Parameters shared by several stages are written one file per key; their keys follow the pipeline's name.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

from structlearn.core.errors import InputError
from structlearn.core.params import value_at
from structlearn.core.publication import publish
from structlearn.core.source_closure import SourceTree
from structlearn.core.stage import PARAMETER_FILE, run

SCRIPTS = Path(__file__).parent
NO_STAGES = ("list_code.py", "make_example.py")


def scripts(pipeline: str) -> Iterator[Path]:
    """Scripts of the `main` pipeline, or of a pipeline whose `dvc.yaml` is in their folder."""
    for script in sorted(SCRIPTS.rglob("*.py")):
        its = script.parent.name if (script.parent / "dvc.yaml").exists() else "main"
        if its == pipeline and script.name not in NO_STAGES:
            yield script


def main() -> None:
    pipeline, *shared = sys.argv[1:] or [""]
    listed, sources = list(scripts(pipeline)), SourceTree(Path("src"))
    if not listed:
        raise InputError(f"{sys.argv[0]}: which pipeline? main, or a folder of stages with a dvc.yaml")
    with publish(Path("data/code", pipeline)) as folder:
        sources.write(listed, folder, SCRIPTS if pipeline == "main" else SCRIPTS / pipeline)
        for key in shared:
            (folder / f"{key}.yaml").write_text(yaml.safe_dump(value_at(PARAMETER_FILE, key)))


if __name__ == "__main__":
    run(main)
