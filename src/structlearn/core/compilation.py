"""Numba with a cache that is shared by all clones and safe for concurrent processes.

Modules with compiled functions import numba from here. Numba alone detects changes only in the file of the
called function: a function that calls one of another module would silently keep that module's old code after
an edit. So every state of the compiled sources has its own cache folder, named by their digest: an edit
recompiles everything (half a minute), a second clone nothing.

The folders are in the user's cache; if that is not writable, beside the sources; else temporary. They are
never where others may write, since cached code is executed.

Numba compiles a caller anew for every function it is given. A controller learns only from a skill's file
which networks it runs, so each network has a kernel, all with one signature, and tables hold their addresses:

    address = PhaseModulatedNetwork.kernel.address                # of the function decorated with `kernel`
    c = call(address, sizes, values, row, deviations, memory)     # in any compiled function

An address is valid in its process only.
"""

import atexit
import errno
import fcntl
import hashlib
import os
import shutil
import threading
import time
import zlib
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numba as numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import caching
from numba.core.errors import TypingError
from numba.core.event import Event, Listener, register
from numba.extending import intrinsic

_CONFIG: Any = numba.config  # attributes are set on import
PACKAGE = Path(__file__).resolve().parents[1]
MARK = b"numba"  # only files that contain it affect compilation
LOCK = "lock"
UNUSED_S = 30 * 86400.0  # age after which caches of other source states are removed


class RelativeLocator(caching.UserProvidedCacheLocator):
    """Caches compiled functions of the package by module, not by the path of its folder."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Folder within the cache for the functions of a file."""
        folder = Path(py_file).resolve().parent
        if folder.is_relative_to(PACKAGE):
            return str(folder.relative_to(PACKAGE.parent))
        return super().get_suitable_cache_subpath(py_file)


class Locks(Listener):
    """One lock of all processes for each compiled function, held until it is saved or the compiler ends.

    Compiling a function compiles its callees, so a process may hold several. They are byte ranges of one
    file: the system gives these back when a process ends, does not share them with forked ones, and refuses
    one for which two processes would wait for each other.
    """

    def __init__(self) -> None:
        self._entry = threading.Lock()
        self._depth = 0
        self._file = -1

    def on_start(self, event: Event) -> None:
        """Open the file of locks."""
        with self._entry:
            if self._depth == 0:
                use_own_cache(PACKAGE)  # numba forgets it when a variable of its own has changed
                path = Path(_CONFIG.CACHE_DIR, LOCK)
                path.parent.mkdir(parents=True, exist_ok=True)
                self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
                os.utime(path)
            self._depth += 1

    def on_end(self, event: Event) -> None:
        """Close the file, which releases what a failed compilation still holds."""
        with self._entry:
            self._depth -= 1
            if self._depth == 0:
                os.close(self._file)

    def acquire(self, function: str) -> bool:
        """Wait for a function's lock; False: its owner waits for this process."""
        try:
            fcntl.lockf(self._file, fcntl.LOCK_EX, 1, zlib.crc32(function.encode()))
        except OSError as error:  # network file systems may not support locks
            return error.errno != errno.EDEADLK
        return True

    def release(self, function: str) -> None:
        """Let the next process have a function's lock."""
        with suppress(OSError):
            fcntl.lockf(self._file, fcntl.LOCK_UN, 1, zlib.crc32(function.encode()))


class SharedFiles(caching.IndexDataCacheFile):
    """Index and data of a function, which one process at a time loads, or compiles and saves.

    Numba replaces them in two steps, so two processes that save a function at the same time would mix them.
    Others wait, then load what was saved. What two processes would wait for each other for is compiled by
    both and saved by one.
    """

    def load(self, key: Any) -> Any:
        """Load a compiled function; if there is none, keep its lock."""
        if not locks.acquire(self._index_name):
            return None
        data = super().load(key)
        if data is not None:
            locks.release(self._index_name)
        return data

    def save(self, key: Any, data: Any) -> None:
        """Save a compiled function, and release its lock."""
        if locks.acquire(self._index_name):
            super().save(key, data)
            locks.release(self._index_name)


def use_own_cache(package: Path) -> None:
    """Point numba to the cache of the present sources in `package`, unless the user has chosen one."""
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
    import tempfile  # rarely needed

    own = tempfile.TemporaryDirectory(prefix=f"{package.name}-")
    atexit.register(own.cleanup)
    return Path(own.name)


def sources_digest(package: Path) -> str:
    """Digest (16 hexadecimal digits) of a folder's files with compiled functions."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if MARK in content:
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + content)
    return digest.hexdigest()[:16]


use_own_cache(PACKAGE)
locks = Locks()
register("numba:compiler_lock", locks)
caching.IndexDataCacheFile = SharedFiles  # type: ignore[misc]  # numba looks it up for each function

# after the cache's settings, which decorated functions read when they are defined

compiled_inside = partial(
    numba.njit, cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True
)()
"""Decorator for functions called only by compiled functions: without Python wrappers, which take longer to
compile than a function with many arrays."""


@numba.njit(cache=True, inline="always")
def cross(a: np.ndarray | tuple[Any, ...], b: np.ndarray | tuple[Any, ...]) -> tuple[Any, ...]:
    """Cross product of two 3-vectors, faster than a call of linear algebra."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


_NUMBERS = types.float64[::1]

kernel = numba.cfunc(types.float64(types.int64[::1], *4 * [_NUMBERS]), cache=True)
"""Compile the forward pass of a network at one sample: (sizes, values, row, deviations, memory) -> c.

All arguments are contiguous arrays. `sizes`, `values` and `memory` may be longer than the network needs, as
tables are padded. The memory is 0 when a movement begins, and persists from sample to sample.
"""


@intrinsic
def _call(
    context: Any, address: Any, sizes: Any, values: Any, row: Any, deviations: Any, memory: Any
) -> tuple[Any, Any]:
    arrays = (sizes, values, row, deviations, memory)
    if not all(isinstance(kind, types.Array) and kind.ndim == 1 and kind.layout == "C" for kind in arrays):
        raise TypingError(f"a kernel takes contiguous arrays, not {arrays}")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in signature.args[1:]]
        function = ir.FunctionType(ir.DoubleType(), kinds).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), arguments[1:])

    return types.float64(types.int64, *arrays), generate


@numba.njit(cache=True, forceinline=True)
def call(
    address: int,
    sizes: np.ndarray,
    values: np.ndarray,
    row: np.ndarray,
    deviations: np.ndarray,
    memory: np.ndarray,
) -> float:
    """Call a kernel from compiled code; see `kernel`."""
    return _call(address, sizes, values, row, deviations, memory)  # type: ignore[call-arg]  # numba adds one
