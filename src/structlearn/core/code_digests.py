"""Digests of code by package folder: what stages of a project outside of its code's folder depend on.

DVC sees them as parameters, so an update of a package reruns the stages that name its folder.
"""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import yaml

from structlearn.core.publication import publish

CODE = Path(".structlearn.yaml")
LIBRARY = Path(__file__).parents[1]
DEFAULTS = "params.yaml"  # reaches stages by the parameters of their task


def write_code(folder: Path, sources: Iterable[Path]) -> None:
    """Write the digests of packages into a project, unless they are there already."""
    text = "# Digests of code by package folder: written before DVC runs\n"
    text += yaml.safe_dump(dict(code_digests(sources)), sort_keys=False)
    path = folder / CODE
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        with publish(path) as target:
            target.write_text(text, encoding="utf-8")


def code_digests(sources: Iterable[Path]) -> Iterator[tuple[str, str]]:
    """Name (`code_key`) and digest of each folder of packages, without its subpackages."""
    for source in sources:
        files: dict[str, list[Path]] = {}
        for file in sorted(source.rglob("*")):
            hidden = "__pycache__" in file.parts or file.name.startswith(".") or file.name == DEFAULTS
            if file.is_file() and not hidden:
                package = next(folder for folder in file.parents if (folder / "__init__.py").exists())
                files.setdefault(code_key(package, source), []).append(file)
        for key, members in files.items():
            digest = hashlib.sha256()
            for file in members:
                digest.update(file.relative_to(source).as_posix().encode() + b"\0" + file.read_bytes())
            yield key, digest.hexdigest()[:16]


def code_key(package: Path, source: Path = LIBRARY) -> str:
    """Name of a package's folder: `core`, `tasks_motion`; of others than this package `mine_readers`."""
    parts = package.relative_to(source).parts
    return "_".join(parts if parts and source == LIBRARY else (source.name, *parts))
