"""A stage of two processes, killed: alone, with its processes, early, late; `make kills` kills real ones."""

import pytest
from faults.kills import HEALED, LIVES_ON, NOT_KILLED, healed, started

from structlearn.core.parallel import BACKEND

STAGE = """
import sys, time
from pathlib import Path
from structlearn.core.parallel import parallel_map
from structlearn.core.publication import publish
from structlearn.core.stage import run

def work(number):
    Path("begun").touch()  # not before: a kill while a semaphore is made leaves glibc's unnamed half of it
    time.sleep(0.1)
    return number**2

def main():
    with publish("out") as folder:
        folder.mkdir()
        for number in parallel_map(work, range(6), "numbers"):
            (folder / f"{number}.txt").write_text(str(number))

run(main)
"""


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Where the stage has run."""
    monkeypatch.delenv(BACKEND)
    (tmp_path / "stage.py").write_text(STAGE)
    with started(tmp_path, "python stage.py") as process:
        assert process.communicate() == (None, b"")
    return tmp_path


def written(project):
    files = (path for path in project.rglob("*") if path.is_file() and "reports" not in path.parts)
    return {path.relative_to(project).as_posix(): path.read_text() for path in files}


@pytest.mark.parametrize("alone", [True, False])
def test_a_killed_stage_done_again_leaves_the_same(project, alone):
    before = written(project)
    (project / "begun").unlink()
    due = (project / "begun").exists
    assert healed(project, "python stage.py", 60.0, due, alone) == (HEALED, "")
    assert written(project) == before


def test_a_stage_that_ends_early_is_not_counted_as_killed(project):
    assert healed(project, "python stage.py", 60.0, lambda: False, alone=True)[0] == NOT_KILLED


def test_who_lives_on_is_found_and_ended(tmp_path, monkeypatch):
    monkeypatch.setattr("faults.kills.END_S", 0.3)
    (tmp_path / "stage.py").write_text(
        "import os, time, pathlib\nif not os.fork():\n pathlib.Path('begun').touch()\ntime.sleep(30)\n"
    )
    assert healed(tmp_path, "python stage.py", 60.0, (tmp_path / "begun").exists, True)[0] == LIVES_ON
