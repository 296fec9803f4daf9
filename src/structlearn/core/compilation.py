"""Cache folder of numba: one per state of the compiled sources.

Numba looks for changes only in the file of the function that is called. A compiled function that calls one of
another module would go on with the old code of that module, silently, after an edit. With a folder of its own
for every state of the sources, an edit compiles everything anew (half a minute) and nothing stale is run.

It is kept beside the sources; where these may not be written, among the user's caches; where there are none,
for this process alone. Never where others may write: what is kept is run.
"""

import atexit
import hashlib
import os
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
MARK = b"numba"  # files that contain it count; all others cannot change what is compiled


def use_own_cache(package: Path) -> None:
    """Point numba to the folder for the present sources, unless the user has chosen one.

    `package`: folder of the package; call before numba is imported.
    """
    if VARIABLE not in os.environ:
        os.environ[VARIABLE] = str(_kept_in(package) / f"compiled-{sources_digest(package)}")


def _kept_in(package: Path) -> Path:
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    for folder in (package / "__pycache__", Path(caches, package.name)):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    import tempfile  # seldom needed

    own = tempfile.TemporaryDirectory(prefix=f"{package.name}-")
    atexit.register(own.cleanup)
    return Path(own.name)


def sources_digest(package: Path) -> str:
    """Digest of a folder's files with compiled functions, names and contents: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if MARK in content:
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + content)
    return digest.hexdigest()[:16]
