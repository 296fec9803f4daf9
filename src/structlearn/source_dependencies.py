"""Which of the project's own modules a stage runs, so that DVC reruns a stage when its code changes.

`python -m structlearn.source_dependencies` (or `make deps`) rewrites the source files among the deps of every
stage in the project's `dvc.yaml` files; a test checks that they are up to date.
"""

import ast
from pathlib import Path

from ruamel.yaml import YAML

PIPELINES = ("dvc.yaml", "stages/recorded/dvc.yaml")
SOURCE = Path("src")


def source_dependencies(script: Path, root: Path = Path()) -> list[str]:
    """The script and all modules of the project that it imports, directly or not.

    Imports are read from the source, those inside functions too; nothing is run.

    Args:
        script: path relative to the root.
        root: the project's root.

    Returns:
        Paths relative to the root, sorted, the script first.
    """
    found: set[Path] = set()
    waiting = [script]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imports(path, root)
    return [script.as_posix(), *sorted(path.as_posix() for path in found - {script})]


def _imports(path: Path, root: Path) -> list[Path]:
    """Files that one file imports from the project; importing a module runs the packages above it too."""
    names = set()
    for node in ast.walk(ast.parse((root / path).read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    files = []
    for name in names:
        parts = name.split(".")
        above = [SOURCE.joinpath(*parts[:depth], "__init__.py") for depth in range(1, len(parts) + 1)]
        files += [*above, SOURCE.joinpath(*parts).with_suffix(".py")]
    return [file for file in files if (root / file).is_file()]


def update(pipeline: Path, root: Path = Path()) -> bool:
    """Rewrite the source deps of all stages of a `dvc.yaml`; the first dep of a stage stays its script.

    Args:
        pipeline: path of the `dvc.yaml` relative to the root.
        root: the project's root.

    Returns:
        Whether anything changed.
    """
    yaml = YAML()
    yaml.width = 110
    yaml.indent(mapping=2, sequence=4, offset=2)
    tree = yaml.load((root / pipeline).read_text())
    changed = False
    for stage in tree["stages"].values():
        data = [dep for dep in stage["deps"] if not dep.endswith(".py")]
        script = Path(stage["cmd"].split()[1])
        deps = [*source_dependencies(script, root), *data]
        if deps != list(stage["deps"]):
            stage["deps"][:] = deps
            changed = True
    if changed:
        with (root / pipeline).open("w") as file:
            yaml.dump(tree, file)
    return changed


if __name__ == "__main__":
    for name in PIPELINES:
        print(f"{name}: {'updated' if update(Path(name)) else 'up to date'}")
