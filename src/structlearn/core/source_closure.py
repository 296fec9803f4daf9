"""Source files that a script imports, with digests: the code that a DVC stage depends on.

Imports are read from the syntax tree, also inside functions. Digests ignore docstrings, comments, layout and
annotations of functions, so that edits of wording do not rerun stages.
"""

import ast
import hashlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from structlearn.core.used_files import remember

DATA_SUFFIXES = (".yaml", ".jinja", ".css", ".js")  # data that modules read from their folder, or below it
PACKAGE = "structlearn"
MODULE_NAME = re.compile(rf"{PACKAGE}(\.\w+)+\.?")


class SourceTree:
    """Sources below a folder, e.g. `src`, each read once; imports of other packages are not followed."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._read: dict[Path, tuple[str, set[Path]]] = {}
        self._found: dict[str, set[Path]] = {}
        self._faces: dict[Path, dict[str, str]] = {}

    def closure(self, script: Path) -> dict[Path, str]:
        """Digest of each file that a script imports, directly or indirectly, by path relative to the root.

        A string that is a module's name counts as an import of the module; a package's name followed by a
        dot, or `package.__name__`, as an import of all its modules. Data files beside a module are included.
        Names of a lazily loaded package are resolved by its stub. Raises SyntaxError: a file is not Python,
        or uses relative imports.
        """
        found: dict[Path, str] = {}
        waiting = self._file(script)[1] - _data_files(script.parent)  # task entries lie beside scripts
        while waiting:
            path = waiting.pop()
            if path not in found:
                found[path], used = self._file(path)
                waiting |= used
        return {path.relative_to(self.root): found[path] for path in sorted(found)}

    def write(self, scripts: Iterable[Path], folder: Path, root: Path | None = None) -> None:
        """Write the closure of each script as `NAME.txt`, a line per file, mirroring folders below `root`."""
        for script in scripts:
            path = (folder / (script.relative_to(root) if root else script.name)).with_suffix(".txt")
            lines = [f"{digest[:16]} {file.as_posix()}\n" for file, digest in self.closure(script).items()]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("".join(lines), encoding="utf-8")

    def _file(self, path: Path) -> tuple[str, set[Path]]:
        """Digest of a file, and the files that it uses."""
        if path not in self._read:
            remember(path)
            content, used = path.read_bytes(), set()
            if path.suffix == ".py":
                tree = ast.parse(content, str(path))
                if b"lazy_loader" in content:
                    tree.body = [node for node in tree.body if not _attaches_face(node)]
                _remove_wording(tree)
                words: list[str] = []
                _flatten(tree, words)
                content = "\n".join(words).encode()
                used = {file for name in _names(tree) for file in self._modules(name)}
                if path.is_relative_to(self.root):
                    used |= _data_files(path.parent)
            self._read[path] = hashlib.sha256(content).hexdigest(), used
        return self._read[path]

    def _modules(self, name: str) -> set[Path]:
        """Files that run on import of a dotted name: the module and its parent packages."""
        if name not in self._found:
            self._found[name] = self._searched(name)
        return self._found[name]

    def _searched(self, name: str) -> set[Path]:
        parts = name.rstrip(".").split(".")
        if parts[0] != PACKAGE:  # others stand beside it in an environment
            return set()
        place = self.root.joinpath(*parts[:-1])
        if (place / "__init__.pyi").exists() and (module := self._face(place).get(parts[-1])):
            parts[-1] = module
        places = [self.root.joinpath(*parts[:depth]) for depth in range(1, len(parts) + 1)]
        files = {file for place in places for file in (place / "__init__.py", place.with_suffix(".py"))}
        if name.endswith("."):
            files |= set(places[-1].glob("*.py"))
        return {file for file in files if file.is_file()}

    def _face(self, package: Path) -> dict[str, str]:
        """Module that defines each name in a package's stub."""
        if package not in self._faces:
            stub = ast.parse((package / "__init__.pyi").read_text(encoding="utf-8"))
            imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
            self._faces[package] = {alias.name: str(one.module) for one in imports for alias in one.names}
        return self._faces[package]


def _attaches_face(node: ast.AST) -> bool:
    """Whether a statement sets up lazy loading of a package, resolved by `_face`."""
    return "lazy_loader" in {getattr(one, "id", getattr(one, "name", "")) for one in ast.walk(node)}


def _remove_wording(tree: ast.Module) -> None:
    """Remove docstrings, other bare strings, and annotations of functions, in place."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [one for one in body if not _is_bare_string(one)]  # type: ignore[attr-defined]


def _is_bare_string(node: ast.AST) -> bool:
    match node:
        case ast.Expr(ast.Constant(str())):
            return True
    return False


def _names(tree: ast.Module) -> Iterator[str]:
    """Dotted names of modules or their members that a file imports or mentions; see `closure`."""
    packages: dict[str, str] = {}
    named: list[str] = []  # names whose `__name__` is used
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise SyntaxError(f"relative import in line {node.lineno}: modules are named in full")
            packages |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Constant) and MODULE_NAME.fullmatch(str(node.value)):
            yield str(node.value)
        elif isinstance(node, ast.Attribute) and node.attr == "__name__" and isinstance(node.value, ast.Name):
            named.append(node.value.id)
    yield from packages.values()
    yield from (f"{packages[name]}." for name in named if name in packages)


def _flatten(node: object, words: list[str]) -> None:
    """Flatten the tree to words; empty fields are left out, so that all versions of Python agree."""
    if isinstance(node, ast.AST):
        words.append(type(node).__name__)
        for field in node._fields:
            value = getattr(node, field, None)
            if value is None or value == []:
                continue
            words.append(field)
            if isinstance(value, list):
                for one in value:
                    _flatten(one, words)
                words.append("]")
            else:
                _flatten(value, words)
    else:
        words.append(repr(node))


@cache
def _data_files(folder: Path) -> set[Path]:
    """Data files of a folder and of folders below it without modules."""
    below = [one for one in folder.iterdir() if one.is_dir() and not any(one.glob("**/*.py"))]
    files = [*folder.iterdir(), *(file for one in below for file in one.rglob("*"))]
    return {file for file in files if file.suffix in DATA_SUFFIXES}
