"""Atomic publishing: a file or a folder appears at its place when it is complete, or not at all.

It is written beside its place under a temporary name, synced to disk and renamed, so neither a killed stage
nor a power cut leaves anything half-written, and two processes never write one target.
"""

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from structlearn.core.errors import InputError


@contextmanager
def publish(target: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `target`; move what was written there in place on success.

    The caller writes a file at the path, which has the target's suffix, or makes a folder of it. Parent
    folders are made. Nothing appears at `target` when the body raises, and what stood there before stays.
    Raises InputError: the disk is full or may not be written on, or another process publishes the target.
    """
    target = Path(target)
    workspace = target.parent / f".publish-{target.name}"
    replaced, temporary = workspace / "replaced", workspace / target.name
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with alone_in(workspace, f"{target}: another process is writing it"):
            if replaced.exists() and not target.exists():  # killed between the two moves below
                replaced.rename(target)
            for left in workspace.iterdir():  # by a killed run
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
            try:
                yield temporary
                _to_disk(temporary)
                if target.is_dir() and temporary.exists():  # nothing written: the old content stays
                    target.rename(replaced)  # a folder cannot be replaced in one step
                os.replace(temporary, target)
                _to_disk(target.parent, deep=False)
            finally:
                shutil.rmtree(workspace, ignore_errors=True)
    except OSError as error:
        if (fault := disk_fault(error)) is None:
            raise
        raise InputError(f"{target}: cannot be written: {fault}") from error


def disk_fault(error: OSError) -> str | None:
    """Why the machine did not write a file; None for other errors."""
    return os.strerror(error.errno) if error.errno and error.errno in OF_THE_DISK else None


OF_THE_DISK = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG", "EROFS", "EACCES", "EPERM", "ENAMETOOLONG", "ENOTDIR")
}
"""Write errors caused by the machine."""

_locks: set[int] = set()  # open files by which this process holds its workspaces


@contextmanager
def alone_in(workspace: Path, complaint: str) -> Iterator[None]:
    """Lock a folder, which is made if need be, against other processes; an InputError if one has the lock."""
    while True:
        workspace.mkdir(exist_ok=True)
        lock = os.open(workspace, os.O_RDONLY)
        _locks.add(lock)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if workspace.exists() and os.path.samestat(os.fstat(lock), workspace.stat()):
                yield
                return
        except BlockingIOError as error:  # whoever had it before us may have removed it: then try again
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
    """Wait until a file, or a folder with all below it, has reached the disk."""
    inside = path.rglob("*") if deep and path.is_dir() else ()
    for entry in (*inside, path):
        if entry.exists() and not entry.is_symlink():
            file = os.open(entry, os.O_RDONLY)
            try:
                os.fsync(file)
            finally:
                os.close(file)
