"""Package folders that a module imports, directly or through others, read from the sources."""

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src"


def packages(*files: Path) -> set[Path]:
    """Folders below `src` of all modules that files import, also inside functions; and of the files there.

    Importing a package that resolves no names by a stub takes in all its modules: they are looked up by name.
    """
    found, waiting = set[Path](), {file.resolve() for file in files}
    while waiting:
        file = waiting.pop()
        found.add(file)
        waiting |= imported(file) - found
    return {file.parent for file in found if file.is_relative_to(SOURCE)}


@cache
def imported(file: Path) -> frozenset[Path]:
    """Files of this project that a file imports."""
    names = list[str]()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{file}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return frozenset(path for name in names for path in modules(name))


def modules(name: str) -> Iterable[Path]:
    """Files that a dotted name stands for: a module, a name in one, or all modules of a package."""
    place = SOURCE.joinpath(*name.split("."))
    if place.with_suffix(".py").is_file():
        return [place.with_suffix(".py")]
    if (place / "__init__.py").is_file():
        return [] if (place / "__init__.pyi").exists() else place.glob("*.py")
    parent = place.parent
    if parent.with_suffix(".py").is_file():
        return [parent.with_suffix(".py")]
    if (parent / "__init__.pyi").is_file():
        return modules(f"{'.'.join(name.split('.')[:-1])}.{defined_in(parent)[place.name]}")
    return [parent / "__init__.py"] if (parent / "__init__.py").is_file() else []


@cache
def defined_in(package: Path) -> dict[str, str]:
    """Module that defines each name in a package's stub."""
    stub = ast.parse((package / "__init__.pyi").read_bytes())
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: str(node.module) for node in imports for alias in node.names}
