"""The wheel in an environment of its own, away from the clone: from recordings to an exported task."""

import zipfile
from pathlib import Path

import pytest
from wheels import SITE, build, install, run

from dissertation.simulation.pick_and_place import takes, write_takes

ROBOT = """\
    robot:
      urdf: franka_panda/panda.urdf
      tip: panda_grasptarget
      locked_joints: [panda_finger_joint1, panda_finger_joint2]
"""
DVC = """\
#!{python}
import sys
from dvc.cli import main
sys.exit(main())
"""


@pytest.fixture(scope="module")
def wheel(root, tmp_path_factory) -> Path:
    return build(root, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory) -> Path:
    """An environment with the wheel; all other packages are links to those that the tests run with."""
    folder = tmp_path_factory.mktemp("environment")
    install(
        wheel,
        folder,
        (one for one in SITE.iterdir() if not one.name.startswith(("structlearn", "__editable__"))),
    )
    dvc = folder / "bin/dvc"
    dvc.write_text(DVC.format(python=folder / "bin/python"))
    dvc.chmod(0o755)
    return folder


def test_recordings_become_a_checked_skill_without_a_clone(environment, root, tmp_path):
    show_paths = "import structlearn, sys; print(structlearn.__file__, *sys.path, sep='\\n')"
    file, *paths = run(tmp_path, environment / "bin/python", "-c", show_paths).splitlines()
    assert Path(file).is_relative_to(environment)
    assert str(root / "src") not in paths
    examples = Path(run(tmp_path, environment / "bin/structlearn", "examples").strip())
    assert examples.is_relative_to(environment.resolve())
    assert (examples / "learn_from_bags.py").exists()

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
    files = [file for file in (root / "src/structlearn").rglob("*") if file.is_file()]
    there = {file.relative_to(root / "src").as_posix() for file in files if file.suffix != ".pyc"}
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    share, shared = "share/structlearn/examples/", {name for name in packed if ".data/" in name}
    assert packed - shared == there
    examples = {file.name for file in (root / "examples").glob("*.*")}
    assert {name.partition(share)[2] for name in shared} == examples
    assert wheel.stat().st_size < 1e6
