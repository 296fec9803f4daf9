"""Atomic publishing: a file or folder appears at its place when it is complete, or not at all.

It is written beside its place under a temporary name, synced to disk and renamed. So neither a killed stage
nor a power cut leaves incomplete files, and two processes never write the same target.
"""

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from structlearn.core.errors import InputError
from structlearn.core.used_files import WORKSPACE, forget, require_unchanged


@contextmanager
def publish(target: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `target`, and move what was written there in place on success.

    The caller writes a file at the path, which has the target's suffix, or makes a folder of it. Parent
    folders are created. If the body raises, `target` keeps its previous content, if any. Raises InputError:
    the disk is full or not writable, another process is publishing the target, or
    something that the running stage uses has changed (`used_files`).
    """
    target = Path(target)
    workspace = target.parent / f"{WORKSPACE}{target.name}"
    replaced, temporary = workspace / "replaced", workspace / target.name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with alone_in(workspace, f"{target}: another process is writing it"):
            if replaced.exists() and not target.exists():  # killed between the two renames below
                replaced.rename(target)
            for left in workspace.iterdir():  # left by a killed run
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
            try:
                yield temporary
                _to_disk(temporary)
                require_unchanged(target)
                if target.is_dir() and temporary.exists():  # else nothing was written, and the old one stays
                    target.rename(replaced)  # folders cannot be replaced in one step
                os.replace(temporary, target)
                forget(target)
                _to_disk(target.parent, deep=False)
            finally:
                shutil.rmtree(workspace, ignore_errors=True)
    except OSError as error:
        if (fault := disk_fault(error)) is None:
            raise
        raise InputError(f"{target}: cannot be written: {fault}") from error


def disk_fault(error: OSError) -> str | None:
    """Reason why the machine could not write a file; None for other errors."""
    return os.strerror(error.errno) if error.errno and error.errno in OF_THE_DISK else None


OF_THE_DISK = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EACCES", "EPERM", "ENAMETOOLONG", "ENOTDIR")
}
"""Write errors caused by the machine."""

_locks: set[int] = set()  # open files that hold this process's locks


@contextmanager
def alone_in(workspace: Path, complaint: str) -> Iterator[None]:
    """Lock a folder, created if needed, against other processes. Raises InputError: it is locked."""
    while True:
        workspace.mkdir(exist_ok=True)
        lock = os.open(workspace, os.O_RDONLY)
        _locks.add(lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if workspace.exists() and os.path.samestat(os.fstat(lock), workspace.stat()):
                yield
                return
        except BlockingIOError as error:  # the previous owner may have removed the folder: retry
            raise InputError(complaint) from error
        finally:
            _locks.discard(lock)
            os.close(lock)


def _let_go() -> None:
    """Close inherited locks in a forked process, so that they end with its parent."""
    while _locks:
        os.close(_locks.pop())


os.register_at_fork(after_in_child=_let_go)


def _to_disk(path: Path, deep: bool = True) -> None:
    """Flush a file, or a folder with everything in it, to disk."""
    inside = path.rglob("*") if deep and path.is_dir() else ()
    for entry in (*inside, path):
        if entry.exists() and not entry.is_symlink():
            file = os.open(entry, os.O_RDONLY)
            try:
                os.fsync(file)
            finally:
                os.close(file)
