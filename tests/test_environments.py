"""The same bytes in other places, for other users, with other settings, as far as this machine has them."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from readers_bags import make_recording

from structlearn.readers import write_recordings

STAGE = """
from pathlib import Path

import pandas as pd
from structlearn.core.artefacts import write_metrics, write_table
from structlearn.core.publication import publish
from structlearn.core.stage import run, stage_parameters
from structlearn.readers import read_demonstrations, write_recordings
from structlearn.readers.bag_recording import read_recordings
from structlearn.readers.source import ClockParameters


def main():
    clock = stage_parameters("clock", ClockParameters)
    with publish("data/raw") as folder:
        write_recordings(read_recordings("bags"), folder)
    (one,) = read_demonstrations("data/raw", rate_hz=clock.rate_hz, max_gap_s=clock.max_gap_s)
    write_table(pd.DataFrame(one.position, columns=list("xyz")), "data/position.parquet")
    write_metrics({"duration_s": one.time[-1], "name": one.name}, "data/metrics.json")
    with publish("data/page.html") as page:
        page.write_text("3 \\N{MICRO SIGN}m \\N{EN DASH} 机器人", encoding="utf-8")


run(main)
"""

PARAMETERS = "clock: {rate_hz: 50.0, max_gap_s: 0.5}  # Hz; s, about 3 µm of motion\n"

COMPILED = """
import numpy as np
from structlearn.primitives.orientation import turned
print(sum(turned(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))))
"""

ORDINARY = 65534  # the user `nobody`, who owns nothing
OTHER_USER = {"user": ORDINARY, "group": ORDINARY, "extra_groups": []}


def make_project(folder: Path) -> Path:
    """A stage, its parameters and a recording."""
    folder.mkdir(parents=True)
    (folder / "stage.py").write_text(STAGE)
    (folder / "params.yaml").write_text(PARAMETERS, encoding="utf-8")
    write_recordings([make_recording("Versuch 1", count=30)], folder / "bags")
    return folder


def run(folder: Path, *words: str, interpreter: str = sys.executable, **options) -> str:
    """What Python says to some words in a project; `variables` are added to the environment."""
    inherited = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    variables = inherited | options.pop("variables", {})
    done = subprocess.run(
        [interpreter, *words], cwd=folder, env=variables, capture_output=True, text=True, **options
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def results(folder: Path) -> dict[str, bytes]:
    """All that a stage wrote."""
    files = (path for path in (folder / "data").rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> dict[str, bytes]:
    """What the stage writes here and now."""
    folder = make_project(tmp_path_factory.mktemp("here") / "project")
    run(folder, "stage.py")
    found = results(folder)
    assert len(found) == 4
    return found


@pytest.fixture(scope="module")
def open_folder() -> Path:
    """A folder that every user may look into; pytest keeps its own to whoever runs it."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        yield Path(folder)


@pytest.fixture(scope="module")
def checkout(root, open_folder) -> Path:
    """A copy of the sources that nobody may write in, in a folder with a name that careless programs miss."""
    sources = open_folder / "Kopie von 机器人 (2)" / "src"
    shutil.copytree(root / "src", sources, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for path in [sources, *sources.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    yield sources
    for path in [sources, *sources.rglob("*")]:
        path.chmod(0o755 if path.is_dir() else 0o644)


def test_a_path_with_other_letters_in_a_language_without_them_and_files_for_their_owner_alone(
    tmp_path, checkout, expected
):
    folder = make_project(tmp_path / "Daten vom 3. März & mehr")
    plain = {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    run(folder, "stage.py", variables=plain | {"PYTHONPATH": str(checkout)}, umask=0o077)
    assert results(folder) == expected
    assert all(path.stat().st_mode & 0o077 == 0 for path in (folder / "data").rglob("*"))


def test_an_ordinary_user_and_sources_that_may_not_be_written(open_folder, checkout, expected):
    folder = make_project(open_folder / "project")
    variables = {"PYTHONPATH": str(checkout), "HOME": "/nonexistent"}
    options = {"variables": variables}
    if os.geteuid() == 0:
        for path in (folder, *folder.rglob("*")):
            os.chown(path, ORDINARY, ORDINARY)
        options |= OTHER_USER | {"interpreter": _for_all(folder)}
    libraries = f"import sys; sys.path.insert(0, {sysconfig.get_path('purelib')!r})\n"  # before the system's
    assert run(folder, "-c", libraries + STAGE + COMPILED, **options) == "1.0\n"
    assert results(folder) == expected


def _for_all(folder: Path) -> str:
    """A Python of this version that another user can run and that finds our libraries."""
    own = f"python{sys.version_info.major}.{sys.version_info.minor}"
    libraries = f"import sys; sys.path.insert(0, {sysconfig.get_path('purelib')!r}); import numpy"
    for interpreter in (sys.executable, f"/usr/bin/{own}", f"/usr/local/bin/{own}"):
        command = [interpreter, "-c", libraries]
        with suppress(OSError):
            if not subprocess.run(command, cwd=folder, capture_output=True, **OTHER_USER).returncode:
                return interpreter
    pytest.skip("no Python here that another user can run")
