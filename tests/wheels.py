"""The package as a wheel, and environments of their own to install it in."""

import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from structlearn.core.parallel import BACKEND

SITE = Path(np.__file__).parents[1]
PIP = (sys.executable, "-m", "pip", "--quiet")
OFFLINE = ("--no-deps", "--no-index")


def run(folder, *words, code: int = 0) -> str:
    """Output of a program that is told nothing of this process's Python; errors, if it is to fail."""
    ours = ("PYTHONPATH", "PYTHONHOME", BACKEND)
    variables = {name: value for name, value in os.environ.items() if name not in ours}
    done = subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == code, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stderr if code else done.stdout


def build(root: Path, folder: Path) -> Path:
    """The wheel, built from a copy of its sources, since building writes beside them."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for part in ("src", "examples"):
        shutil.copytree(root / part, folder / part, symlinks=True, ignore=unwanted)
    for part in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / part, folder)
    run(folder, *PIP, "wheel", *OFFLINE, "--no-build-isolation", "--wheel-dir", folder, folder)
    return next(folder.glob("*.whl"))


def install(wheel: Path, folder: Path, packages: Iterable[Path]) -> None:
    """Make an environment with a wheel, and links to packages that the tests run with."""
    venv.create(folder, symlinks=True)
    site = next(folder.glob("lib/python*/site-packages"))
    for package in packages:
        (site / package.name).symlink_to(package)
    run(folder, *PIP, "--python", folder / "bin/python", "install", *OFFLINE, "--no-compile", wheel)
