"""Read a damaged file in a process of its own, with bounds on memory and time, and say what came of it.

One rule holds: the same data, or one line that names the file, as an `InputError`; recordings go by the
file's name without its suffix.
"""

import hashlib
import json
import os
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import BaseModel

from structlearn.core.errors import InputError

SAME, NAMED, OTHER = "same data", "named in one line", "other data"
TRACEBACK, UNCLEAR, BLOWN_UP, HANGS, KILLED = "traceback", "unclear", "out of memory", "hangs", "killed"
OUTCOMES = (SAME, NAMED, OTHER, TRACEBACK, UNCLEAR, BLOWN_UP, HANGS, KILLED)

MEMORY = 512 * 2**20  # bytes that reading may take beyond what the process has
FULL = 0.8  # share of it that nothing which is refused may take
LONGEST_S = 10  # of the processor; the files are some 10 kB
WAIT_S = 120.0  # on the clock, also where many other processes run


def outcome(read: Callable[[Path], Any], path: Path, sound: str) -> tuple[str, str]:
    """What reading a file comes to, one of `OUTCOMES`, and what was said."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        with os.fdopen(writer, "w") as pipe:
            json.dump(_tried(read, path, sound), pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        ends = time.monotonic() + WAIT_S
        while (ended := os.waitpid(child, os.WNOHANG)) == (0, 0):
            if time.monotonic() > ends:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                return HANGS, f"more than {WAIT_S:g} s"
            time.sleep(0.001)
        said = pipe.read()
    code = os.waitstatus_to_exitcode(ended[1])
    if code == -signal.SIGXCPU:
        return HANGS, f"more than {LONGEST_S} s of the processor"
    return tuple(json.loads(said)) if said else (KILLED, f"the process ended with {code}")


def _tried(read: Callable[[Path], Any], path: Path, sound: str) -> tuple[str, str]:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S + 1))  # of this process alone
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 2)  # parsers in C print
    warnings.simplefilter("ignore")
    try:
        found = fingerprint(read(path))
    except InputError as error:
        line = str(error)
        if 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) > FULL * MEMORY:
            return BLOWN_UP, line  # as if it were damage
        return (NAMED if path.stem in line and line.isprintable() else UNCLEAR), line
    except MemoryError as error:
        return BLOWN_UP, repr(error)
    except BaseException as error:
        return TRACEBACK, repr(error)[:300]
    return (SAME, "") if found == sound else (OTHER, "")


def fingerprint(value: Any) -> str:
    """Digest of data: arrays, tables, mappings, parameters and dataclasses of these."""
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, pd.DataFrame):
        for column in value:
            _feed(digest, str(column))
            _feed(digest, value[column].to_numpy().tolist())
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(digest, key)
            _feed(digest, value[key])
    elif isinstance(value, BaseModel):
        digest.update(value.model_dump_json().encode())
    elif is_dataclass(value):
        for field in fields(value):
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, list | tuple):
        for one in value:
            _feed(digest, one)
    else:
        digest.update(repr(value).encode())


if sys.platform != "linux":  # bounds on memory, and fork
    raise ImportError("trials of damaged files need Linux")
