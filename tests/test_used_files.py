"""A stage fails if what it uses changes while it runs: DVC would record the change with the old result."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import structlearn
from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.publication import publish
from structlearn.core.used_files import COMPARED, require_file, watched

STAGE = """
import time
from pathlib import Path

import beside
from structlearn.core.params import Parameters
from structlearn.core.publication import publish
from structlearn.core.used_files import require_file
from structlearn.core.stage import run, stage_parameters

class Fit(Parameters):
    count: int

def wait(name):
    Path(name + " begun").touch()
    while not Path(name).exists():
        time.sleep(0.005)

def main():
    count = stage_parameters("fit", Fit).count
    for name in ("small.csv", "large.csv"):
        require_file(name)
    for text in ("first", "second"):  # is read again and replaced by the stage itself
        with publish("own") as folder:
            folder.mkdir()
            (folder / "own.txt").write_text(text)
            require_file(folder / "own.txt")
        require_file("own/own.txt")
    wait("run")
    with publish("result.txt") as target:
        target.write_text(str(count))

wait("loaded")
run(main)
"""
PARAMETERS = "fit:\n  count: 40\nother: 1\n"


@pytest.fixture
def project(tmp_path):
    """A stage with its inputs, and a copy of the package whose code may be edited."""
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "beside.py").write_text("rate = 1\n")
    (tmp_path / "unused.py").write_text("rate = 1\n")
    (tmp_path / "params.yaml").write_text(PARAMETERS)
    (tmp_path / "small.csv").write_text("1\n")
    (tmp_path / "large.csv").write_bytes(bytes(COMPARED + 1))
    package = Path(structlearn.__file__).parent
    (tmp_path / "structlearn").mkdir()
    shutil.copy(package / "__init__.py", tmp_path / "structlearn")
    unused = shutil.ignore_patterns("__pycache__")
    shutil.copytree(package / "core", tmp_path / "structlearn/core", ignore=unused)
    return tmp_path


def result(project, edit, moment):
    """What the stage answers if its files are edited at a moment: `loaded` (not yet begun) or `run`."""
    environment = os.environ | {"PYTHONPATH": str(project)}
    with subprocess.Popen(
        [sys.executable, "stage.py"], cwd=project, env=environment, stderr=subprocess.PIPE, text=True
    ) as stage:
        for name in ("loaded", "run"):
            while not (project / f"{name} begun").exists() and stage.poll() is None:
                time.sleep(0.005)
            if name == moment:
                edit(project)
            (project / name).touch()
        said = stage.communicate()[1]
    return stage.returncode, said, (project / "result.txt").exists()


def replacing(name, old, new):
    """An edit as editors make it: a new file takes the place of the old one."""

    def edit(project):
        path = project / name
        (project / "new").write_bytes(path.read_bytes().replace(old, new))
        (project / "new").replace(path)

    return edit


CHANGES = {
    "a parameter": ("run", "params.yaml: fit", replacing("params.yaml", b"40", b"30")),
    "a removed key": ("run", "params.yaml: fit", replacing("params.yaml", b"fit", b"fitted")),
    "a broken file": ("run", "params.yaml: fit", replacing("params.yaml", b"fit:", b"fit: {")),
    "the script": ("run", "stage.py", replacing("stage.py", b"str(count)", b"str(count + 1)")),
    "a module beside it": ("run", "beside.py", replacing("beside.py", b"1", b"2")),
    "the package": (
        "run",
        "structlearn/core/used_files.py",
        replacing("structlearn/core/used_files.py", b"2**30", b"2**31"),
    ),
    "code that was loaded before": ("loaded", "beside.py", replacing("beside.py", b"1", b"2")),
    "an input": ("run", "small.csv", replacing("small.csv", b"1", b"2")),
    "a large input": ("run", "large.csv", replacing("large.csv", b"\0\0", b"\0\1")),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_what_a_stage_uses_fails_it_before_it_publishes(project, change):
    moment, name, edit = CHANGES[change]
    said = f"error: {name} changed while the stage ran; run it again\n"
    assert result(project, edit, moment) == (1, said, False)


def touched(project):
    """New times and new files of equal content, as after changing branches and back."""
    for name in ("params.yaml", "stage.py", "beside.py", "structlearn/core/used_files.py"):
        replacing(name, b"", b"")(project)
    os.utime(project / "small.csv")


@pytest.mark.parametrize(
    ("moment", "edit"),
    [
        ("run", replacing("params.yaml", b"other: 1", b"other: 2  # of another stage")),
        ("run", replacing("unused.py", b"1", b"2")),
        ("run", replacing("structlearn/core/signals.py", b"def ", b"async def ")),
        ("run", touched),
        ("loaded", replacing("params.yaml", b"4", b"4")),
    ],
    ids=["another key", "an unused script", "an unused module", "touched", "not yet read"],
)
def test_what_a_stage_does_not_use_may_change(project, moment, edit):
    assert result(project, edit, moment) == (0, "", True)


def published(target):
    with publish(target) as path:
        path.write_text("whole")
    return target.read_text()


def test_a_change_is_reported_once_and_not_by_processes(tmp_path, monkeypatch):
    monkeypatch.setenv("STRUCTLEARN_BACKEND", "fork")
    monkeypatch.setenv("STRUCTLEARN_PROCESSES", "2")
    path = tmp_path / "input.csv"
    path.write_text("1\n")

    def main():
        require_file(path)
        path.write_text("2\n")
        assert parallel_map(published, [tmp_path / "a", tmp_path / "b"], "files") == ["whole", "whole"]

    with pytest.raises(InputError, match=r"input\.csv changed while the stage ran; run it again$"):
        watched(time.time())(main)()
    published(tmp_path / "c")  # the next stage begins anew
