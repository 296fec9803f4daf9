"""Files that are read: regular ones that fit into memory, which must not change while a stage runs.

DVC digests dependencies when a stage's command has ended. If one is edited meanwhile, DVC would record the
new one with the result of the old one, and `dvc status` would call that result up to date. So readers
`remember` what they read; `publish` and the end of a stage call `require_unchanged`.
"""

import hashlib
import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from structlearn.core.errors import InputError

TEMPLATES = (".jinja", ".css", ".js")  # of the template engine; YAML files are remembered by their reader
WORKSPACE = ".publish-"  # begins names of the folders in which `publish` writes
COMPARED = 2**20  # bytes, digested in a millisecond at most; larger files are compared by time, size, inode
TICK_S = 0.02  # steps of the clocks; an interpreter starts no faster
_MODIFIED = object()  # differs from every content

State = tuple[int, int, int]


LARGEST = 2**30
"""Largest size in bytes of a file that is read as a whole, see also `Budget`."""

PER_MESSAGE = 200
"""Bytes of Python overhead per message."""


@dataclass
class _Used:
    path: Path
    key: str  # of the value used; empty: all of the file
    state: State | None
    content: Any  # None: the file is large
    read: Callable[[], Any]  # content now

    def has_changed(self) -> bool:
        """Compare contents only if the file was written since. A file that is gone is DVC's to report."""
        state = _state(self.path)
        if state is None or (state == self.state and self.content is not _MODIFIED):
            return False
        if self.content is None or self.read() != self.content:
            return True
        self.state = state
        return False


@dataclass
class _Watch:
    inputs: dict[tuple[str, str], _Used]  # by absolute path and key
    sources: dict[str, _Used]  # of the package and beside the script, by absolute path


_watches: list[_Watch] = []  # of the running stage; empty otherwise, and in forked processes
os.register_at_fork(after_in_child=_watches.clear)


@contextmanager
def watched(started_s: float) -> Iterator[None]:
    """Watch what the body uses, see `require_unchanged`, which is called at its end.

    `started_s`: time.time() when the process started; code loaded since then and written later has changed.
    """
    _watches.append(_Watch({}, _sources()))
    try:
        for source in _loaded():
            if source.state and source.state[0] > 1e9 * (started_s + TICK_S):
                source.content = _MODIFIED
        yield
        require_unchanged()
    finally:
        del _watches[-1:]


def remember(path: str | Path) -> None:
    """Remember a file that is about to be read."""
    path = Path(os.path.abspath(path))
    if _watches and not _is_temporary(path):
        _watches[-1].inputs.setdefault((str(path), ""), _used(path))


def remember_value(path: str | Path, key: str, value: Any, read: Callable[[], Any]) -> None:
    """Remember one value of a file, of which `read` is the present one: the rest of the file may change."""
    path = Path(os.path.abspath(path))
    if _watches and not _is_temporary(path):
        _watches[-1].inputs.setdefault((str(path), key), _Used(path, key, _state(path), value, read))


def forget(target: str | Path) -> None:
    """Forget a file or folder that the stage itself has replaced."""
    if _watches:
        target, inputs = Path(os.path.abspath(target)), _watches[-1].inputs
        for place in [place for place, used in inputs.items() if used.path.is_relative_to(target)]:
            del inputs[place]


def require_unchanged(target: str | Path = "") -> None:
    """Raise InputError: something used has changed. Nothing is checked within a folder being published."""
    if _watches and not _is_temporary(Path(target)):
        for used in (*_watches[-1].inputs.values(), *_loaded()):
            if used.has_changed():
                what = f"{os.path.relpath(used.path)}: {used.key}".removesuffix(": ")
                raise InputError(f"{what} changed while the stage ran; run it again")


def _is_temporary(path: Path) -> bool:
    return any(part.startswith(WORKSPACE) for part in path.parts)


def _state(path: Path) -> State | None:
    try:
        state = os.stat(path)
    except OSError:
        return None
    return state.st_mtime_ns, state.st_size, state.st_ino


def _used(path: Path) -> _Used:
    state = _state(path)
    small = state is not None and state[1] <= COMPARED
    return _Used(path, "", state, _content(path) if small else None, partial(_content, path))


def _content(path: Path) -> bytes | None:
    try:
        return hashlib.sha256(path.read_bytes()).digest()
    except OSError:
        return None


def _sources() -> dict[str, _Used]:
    """All code and templates of our packages, and scripts beside this one: some are loaded later."""
    script = Path(os.path.abspath(sys.argv[0]))
    beside = script.parent.glob("*.py") if script.suffix == ".py" else ()
    below = (
        Path(folder, name)
        for package in _packages()
        for folder, _, names in os.walk(package)
        for name in names
        if name.endswith((".py", *TEMPLATES))
    )
    return {str(path): _used(path) for path in (*beside, *below)}


def _packages() -> list[str]:
    """Folders of this package and of those loaded from beside a project, not installed."""
    loaded = (
        folder for name, module in sys.modules.items() if "." not in name for folder in _folders(module)
    )
    own = str(Path(__file__).parents[1])
    installed = (sys.prefix, sys.base_prefix)
    return [own, *(folder for folder in loaded if folder != own and not folder.startswith(installed))]


def _folders(module: object) -> list[str]:
    folders = getattr(module, "__path__", ())
    return [folder for folder in folders if isinstance(folder, str) and "-packages" not in folder]


def _loaded() -> Iterator[_Used]:
    """Sources of loaded modules, and templates beside these or in a folder beside these."""
    sources = _watches[-1].sources
    modules = [module for module in [*sys.modules.values()] if isinstance(module, ModuleType)]
    files = [vars(module).get("__file__") for module in modules]  # `getattr` would load lazy ones
    code = [file for file in files if isinstance(file, str) and file in sources]
    yield from (sources[file] for file in code)
    folders = {os.path.dirname(file) for file in code}
    for file in [file for file in sources if file.endswith(TEMPLATES)]:
        parent = os.path.dirname(file)
        if parent in folders or os.path.dirname(parent) in folders:
            yield sources[file]


def require_file(path: str | Path, whole: bool = True) -> None:
    """As `require_regular`, for an input whose every byte counts: it may not change while the stage runs."""
    require_regular(path, whole)
    remember(path)


def require_regular(path: str | Path, whole: bool = True) -> None:
    """Raise InputError for pipes, devices and files too large to read `whole`; OSError if missing."""
    state = Path(path).stat()
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{path}: cannot be read: not a file")
    if whole and state.st_size > LARGEST:
        raise InputError(f"{path}: has {state.st_size} bytes, more than {LARGEST}")


def digest(path: Path, kind: str = "sha256") -> str:
    """Hexadecimal digest of a file of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, kind).hexdigest()


class Budget:
    """Limit on the bytes that one file unpacks to: a gigabyte plus twenty times its size."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._total = self._left = LARGEST + 20 * path.stat().st_size

    def take(self, count: int) -> None:
        """Count unpacked bytes. Raises InputError: beyond the limit."""
        self._left -= count
        if self._left < 0:
            raise InputError(
                f"{self._path}: it unpacks to more than {self._total} bytes, which is allowed for its size"
            )
