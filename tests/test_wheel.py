"""The wheel in an environment of its own, away from the clone: from recordings to an exported task."""

import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest
from structlearn.tasks.pick_and_place_world import takes, write_takes

from structlearn.core.parallel import BACKEND

ROBOT = """\
    robot:
      urdf: franka_panda/panda.urdf
      tip: panda_grasptarget
      locked_joints: [panda_finger_joint1, panda_finger_joint2]
"""
PIP = (sys.executable, "-m", "pip", "--quiet")
OFFLINE = ("--no-deps", "--no-index")
DVC = """\
#!{python}
import sys
from dvc.cli import main
sys.exit(main())
"""


def run(folder, *words) -> str:
    """Output of a program that is told nothing of this process's Python; it must succeed."""
    ours = ("PYTHONPATH", "PYTHONHOME", BACKEND)
    variables = {name: value for name, value in os.environ.items() if name not in ours}
    done = subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory) -> Path:
    """The wheel, built from a copy of its sources, since building writes beside them."""
    folder = tmp_path_factory.mktemp("wheel")
    for part in ("src", "stages/tasks"):
        unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info")
        shutil.copytree(root / part, folder / part, symlinks=True, ignore=unwanted)
    for part in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(root / part, folder)
    run(folder, *PIP, "wheel", *OFFLINE, "--no-build-isolation", "--wheel-dir", folder, folder)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory) -> Path:
    """An environment with the wheel; all other packages are links to those that the tests run with."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    site = next(folder.glob("lib/python*/site-packages"))
    for package in Path(np.__file__).parents[1].iterdir():
        if not package.name.startswith(("structlearn", "__editable__")):
            (site / package.name).symlink_to(package)
    run(folder, *PIP, "--python", folder / "bin/python", "install", *OFFLINE, "--no-compile", wheel)
    dvc = folder / "bin/dvc"
    dvc.write_text(DVC.format(python=folder / "bin/python"))
    dvc.chmod(0o755)
    return folder


def test_recordings_become_a_checked_skill_without_a_clone(environment, root, tmp_path):
    show_paths = "import structlearn, sys; print(structlearn.__file__, *sys.path, sep='\\n')"
    file, *paths = run(tmp_path, environment / "bin/python", "-c", show_paths).splitlines()
    assert Path(file).is_relative_to(environment)
    assert str(root / "src") not in paths

    bags, lab, command = tmp_path / "bags", tmp_path / "pour", environment / "bin/structlearn"
    bags.mkdir()
    write_takes(takes(1, 2, 3), bags)
    run(tmp_path, command, "new", "pour", "--from", "bags")
    entries = lab / "structlearn.yaml"
    entries.write_text(entries.read_text().replace("    segment:\n", f"{ROBOT}    segment:\n"))
    assert run(lab, command, "run").endswith("reports/tasks/pour/index.html is up to date\n")
    assert (lab / "reports/tasks/pour/index.html").exists()
    assert any(lab.glob("reports/tasks/pour/rerun/*.rrd"))
    assert "\nyes: 0 of " in run(lab, command, "check", "pour")
    assert run(lab, command, "export", "pour") == "pour: LeRobotDataset of 3 episodes\n"


def test_the_wheel_has_every_source_and_data_file(wheel, root):
    package = root / "src/structlearn"
    folders = (package, package / "tasks/stages")  # the latter is a link
    files = [file for folder in folders for file in folder.rglob("*") if file.is_file()]
    there = {
        file.relative_to(root / "src").as_posix() for file in files if file.suffix not in (".pyc", ".lock")
    }
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert packed == there
