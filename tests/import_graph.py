"""What a script imports of the project, directly or indirectly, read from syntax trees."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[1] / "src"


@cache
def modules() -> dict[str, Path]:
    """Every module of both packages by its dotted name; packages by their `__init__.py`."""
    found = {}
    for path in sorted(SOURCES.rglob("*.py")):
        parts = path.relative_to(SOURCES).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def faces() -> dict[str, str]:
    """Module that defines each name of a lazily loaded package, by `package.name`, from the stubs."""
    found = {}
    for stub in SOURCES.rglob("__init__.pyi"):
        package = ".".join(stub.relative_to(SOURCES).parent.parts)
        for node in ast.parse(stub.read_text()).body:
            if isinstance(node, ast.ImportFrom):
                module = f"{package}.{node.module}" if node.level else str(node.module)
                found |= {f"{package}.{alias.name}": module for alias in node.names}
    return found


def named(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Dotted names that statements import: of modules, or of what is in them."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"line {node.lineno}: modules are named in full"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def module_of(name: str) -> str | None:
    """Module of ours that an imported name comes from; None for those of others."""
    candidates = (name, faces().get(name, ""), name.rpartition(".")[0])
    return next((one for one in candidates if one in modules()), None)


@cache
def imported(path: Path) -> frozenset[str]:
    """Modules of ours that a file imports, at its top or inside its functions."""
    found = {module_of(name) for name in named(ast.walk(ast.parse(path.read_text())))}
    return frozenset(one for one in found if one is not None)


@cache
def looked_up(path: Path) -> frozenset[str]:
    """Modules that a file may look up by name: all of a package without a face that it imports by itself."""
    found: set[str] = set()
    for name in named(ast.walk(ast.parse(path.read_text()))):
        package = modules()[name].parent if "." in name and name in modules() else None
        if package and package.name == name.rpartition(".")[2] and not (package / "__init__.pyi").exists():
            found |= {f"{name}.{one.stem}" for one in package.glob("*.py") if one.stem != "__init__"}
    return frozenset(found)


@cache
def closure(script: Path) -> frozenset[str]:
    """Modules of ours that a script imports, directly or indirectly."""
    found: set[str] = set()
    waiting = {*imported(script), *looked_up(script)}
    while waiting:
        module = waiting.pop()
        found.add(module)
        path = modules()[module]
        waiting |= (imported(path) | looked_up(path)) - found
    return frozenset(found)


def code_of(script: Path, depth: int = 2) -> set[Path]:
    """Folders, `depth` names below the sources, of the code that a script uses; and files above these."""
    files = (modules()[module].relative_to(SOURCES) for module in closure(script))
    return {Path(*file.parts[:depth]) for file in files}


def packages(*files: Path) -> set[Path]:
    """Package folders of what files import, and of the files that are modules themselves."""
    used = {modules()[module] for file in files for module in closure(file)} | set(files)
    return {file.parent for file in used if file.is_relative_to(SOURCES)}
