"""List the code that each stage of a pipeline uses, with digests: an edit reruns only what uses it."""

import sys
from collections.abc import Iterator
from pathlib import Path

from structlearn.core.publication import publish
from structlearn.core.source_closure import SourceTree
from structlearn.core.stage import run

SCRIPTS = Path(__file__).parent
NO_STAGES = ("list_code.py", "make_example.py")


def scripts(pipeline: str) -> Iterator[Path]:
    """Of the stages of `main`, or of a pipeline whose `dvc.yaml` lies beside its scripts."""
    for script in sorted(SCRIPTS.rglob("*.py")):
        its = script.parent.name if (script.parent / "dvc.yaml").exists() else "main"
        if its == pipeline and script.name not in NO_STAGES:
            yield script


def main() -> None:
    pipeline = sys.argv[1]
    sources = SourceTree(Path("src"))
    with publish(Path("data/code", pipeline)) as folder:
        sources.write(scripts(pipeline), folder, SCRIPTS if pipeline == "main" else SCRIPTS / pipeline)


if __name__ == "__main__":
    run(main)
