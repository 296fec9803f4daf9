"""Which code made a result: digests of its source folders, and the commit where git knows one."""

import hashlib
import subprocess
from collections.abc import Iterable
from pathlib import Path

UNKNOWN_COMMIT = "unknown commit"
ABSENT = "absent"
SOURCES = ("*.py", "*.yaml")
"""Files that can change a number; templates of pages cannot."""


def source_commit(folders: Iterable[str] = ("src", "stages"), root: Path = Path(".")) -> str:
    """`b9b799a`, or `b9b799a+changes` where folders are not as committed.

    `UNKNOWN_COMMIT` where the project was unpacked from an archive, or git is missing.
    """
    if _git(root, "rev-parse", "--show-prefix") != "":  # none, or that of another project around this one
        return UNKNOWN_COMMIT
    commit = _git(root, "rev-parse", "--short", "HEAD")
    if not commit:
        return UNKNOWN_COMMIT
    return f"{commit}+changes" if _git(root, "status", "--porcelain", "--", *folders) else commit


def code_digests(folders: Iterable[str], root: Path = Path(".")) -> dict[str, str]:
    """A digest of each folder or file of sources: names and contents of `SOURCES`; `ABSENT` without any."""
    return {folder: _digest(root / folder) for folder in sorted(folders)}


def _digest(path: Path) -> str:
    files = [path] if path.is_file() else [file for kind in SOURCES for file in path.rglob(kind)]
    digest = hashlib.sha256()
    for file in sorted(files):
        content = hashlib.sha256(file.read_bytes()).hexdigest()
        digest.update(f"{file.relative_to(path).as_posix()} {content}\n".encode())
    return digest.hexdigest()[:32] if files else ABSENT


def _git(root: Path, *arguments: str) -> str | None:
    """Output of git; None if it fails."""
    try:
        done = subprocess.run(["git", "-C", root, *arguments], capture_output=True, text=True, check=False)
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None
