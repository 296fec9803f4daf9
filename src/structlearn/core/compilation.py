"""Numba, with a cache that is shared by all clones and safe for concurrent processes.

Modules with compiled functions import numba from here. Numba alone looks for changes only in the file of the
function that is called: one that calls a function of another module would silently go on with that module's
old code after an edit. So every state of the compiled sources has a folder of its own, named by its digest
wherever the sources are: an edit recompiles everything (half a minute), a second clone nothing.

The folders are among the user's caches; if these are not writable, beside the sources; else temporary. Never
where others may write, since cached code is executed.
"""

import atexit
import fcntl
import hashlib
import os
import shutil
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core.caching import UserProvidedCacheLocator
from numba.core.event import Event, Listener, register

_CONFIG: Any = numba.config  # which gets its values at its import
PACKAGE = Path(__file__).resolve().parents[1]
MARK = b"numba"  # only files that contain it can change what is compiled
LOCK = "lock"
UNUSED_S = 30 * 86400.0  # after which the code of other states of the sources is removed


class RelativeLocator(UserProvidedCacheLocator):
    """Keeps compiled functions of the package by their module, not by the path of its folder."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Folder within the cache for the functions of a file."""
        folder = Path(py_file).resolve().parent
        if folder.is_relative_to(PACKAGE):
            return str(folder.relative_to(PACKAGE.parent))
        return super().get_suitable_cache_subpath(py_file)


class OneProcess(Listener):
    """Lets one process at a time load, compile and save; the others wait and then load what it has saved.

    Numba replaces index and data of a function in two steps, so two processes that compile it at the same
    time would mix their files.
    """

    def __init__(self) -> None:
        self._entry = threading.Lock()
        self._depth = 0  # compiling a function compiles those that it calls
        self._file = -1

    def on_start(self, event: Event) -> None:
        """Wait for the other processes."""
        with self._entry:
            if self._depth == 0:
                # opened anew: forked processes share a lock with the parent's open file
                path = Path(_CONFIG.CACHE_DIR, LOCK)
                path.parent.mkdir(parents=True, exist_ok=True)
                self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
                os.utime(path)
                with suppress(OSError):  # a network's disk may know no locks
                    fcntl.flock(self._file, fcntl.LOCK_EX)
            self._depth += 1

    def on_end(self, event: Event) -> None:
        """Let the next process go on."""
        with self._entry:
            self._depth -= 1
            if self._depth == 0:
                os.close(self._file)


def use_own_cache(package: Path) -> None:
    """Point numba to the folder for the present sources in `package`, unless the user has chosen one."""
    if not _CONFIG.CACHE_DIR:
        kept = _kept_for(package)
        folder = kept / f"compiled-{sources_digest(package)}"
        for lock in () if folder.exists() else kept.glob(f"compiled-*/{LOCK}"):
            if time.time() - lock.stat().st_mtime > UNUSED_S:
                shutil.rmtree(lock.parent, ignore_errors=True)
        _CONFIG.CACHE_DIR = str(folder)
    if not _CONFIG.CACHE_LOCATOR_CLASSES:
        _CONFIG.CACHE_LOCATOR_CLASSES = (
            f"{__name__}.{RelativeLocator.__name__},IPythonCacheLocator,ZipCacheLocator"
        )


def _kept_for(package: Path) -> Path:
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for folder in (Path(caches, package.name), package / "__pycache__"):
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    import tempfile  # seldom needed

    own = tempfile.TemporaryDirectory(prefix=f"{package.name}-")
    atexit.register(own.cleanup)
    return Path(own.name)


def sources_digest(package: Path) -> str:
    """Digest of a folder's files with compiled functions: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if MARK in content:
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + content)
    return digest.hexdigest()[:16]


use_own_cache(PACKAGE)
register("numba:compiler_lock", OneProcess())

# below the cache's settings, which decorated functions take when they are defined

compiled_inside = partial(
    numba.njit, cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True
)()
"""Decorator of functions that only compiled functions call: without Python wrappers, which take longer to
compile than the function if it has many arrays."""


@numba.njit(cache=True, inline="always")
def cross(a: np.ndarray | tuple, b: np.ndarray | tuple) -> tuple:
    """Vector product of two vectors of three numbers each, faster than a call of linear algebra."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
