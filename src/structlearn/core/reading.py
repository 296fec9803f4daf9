"""Limits on input files: regular files only, and no more of each than fits into memory."""

import hashlib
import stat
from pathlib import Path

from structlearn.core.errors import InputError
from structlearn.core.used_files import remember

LARGEST = 2**30
"""Largest size in bytes of a file that is read as a whole, see also `Budget`."""

PER_MESSAGE = 200
"""Bytes of Python overhead per message."""


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
