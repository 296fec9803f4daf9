"""List the code that each stage of a pipeline uses, with digests, so that edits rerun only affected stages.

Parameters shared by several stages are listed likewise, one file each; their keys follow the pipeline's name.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import yaml

from structlearn.core.params import value_at
from structlearn.core.publication import publish
from structlearn.core.source_closure import SourceTree
from structlearn.core.stage import PARAMETER_FILE, run

SCRIPTS = Path(__file__).parent
NO_STAGES = ("list_code.py", "make_example.py")


def scripts(pipeline: str) -> Iterator[Path]:
    """Scripts of the stages of `main`, or of a pipeline whose `dvc.yaml` is beside its scripts."""
    for script in sorted(SCRIPTS.rglob("*.py")):
        its = script.parent.name if (script.parent / "dvc.yaml").exists() else "main"
        if its == pipeline and script.name not in NO_STAGES:
            yield script


def main() -> None:
    pipeline, *shared = sys.argv[1:]
    sources = SourceTree(Path("src"))
    with publish(Path("data/code", pipeline)) as folder:
        sources.write(scripts(pipeline), folder, SCRIPTS if pipeline == "main" else SCRIPTS / pipeline)
        for key in shared:
            (folder / f"{key}.yaml").write_text(yaml.safe_dump(value_at(PARAMETER_FILE, key)))


if __name__ == "__main__":
    run(main)
