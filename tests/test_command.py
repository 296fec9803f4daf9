"""The command `structlearn`: a project of one's own, away from a clone."""

import runpy
import sys
from pathlib import Path

import pytest
import yaml

from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn import command
from structlearn.core.params import read_values
from structlearn.tasks import project
from structlearn.tasks.task_entry import read_task, targets


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    write_takes(takes(1, 3, 3), folder)
    return folder


@pytest.fixture(scope="module")
def lab(bags, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab") / "pour"
    command.main(["new", str(folder), "--from", str(bags)])
    return folder


def test_a_new_project_has_an_entry_a_pipeline_and_a_repository_of_its_own(lab, bags, monkeypatch):
    monkeypatch.chdir(lab)
    task = read_task("pour")
    assert (task.source, task.topics.pose, len(task.segment.primitives)) == (str(bags), "/gripper/pose", 3)
    stages = [*("import_movement", "segment", "primitives", "feedback", "skill", "check"), "report_movement"]
    assert targets("structlearn.yaml") == [f"dvc.yaml:{stage}@pour" for stage in [*stages, "view_movement"]]
    assert (lab / ".dvc/config").exists()
    assert "/data/tasks" in (lab / ".gitignore").read_text()


def test_its_pipeline_is_that_of_a_clone_and_names_no_file_of_one(lab, root):
    clone = read_values(root / "stages/tasks/dvc.yaml")["stages"]
    mine = yaml.safe_load((lab / "dvc.yaml").read_text())["stages"]
    assert set(mine) - {"code"} == set(clone) - set(project.FOR_CLONES)
    for name, stage in mine.items():
        if name != "code":
            module = stage["do"]["cmd"].removeprefix("python -m structlearn.tasks.stages.")
            assert (project.PACKAGED / f"{module}.py").exists()
            assert stage["do"]["outs"] == clone[name]["do"]["outs"]
            assert not any(str(path).startswith(("stages", "params.yaml")) for path in stage["do"]["deps"])


def test_its_stages_run_from_the_package(lab, monkeypatch):
    monkeypatch.chdir(lab)
    monkeypatch.setattr(sys, "argv", ["stage"])
    for stage in ("import_task", "segment"):
        monkeypatch.setenv("DVC_STAGE", f"dvc.yaml:{stage}@pour")
        runpy.run_module(f"structlearn.tasks.stages.{stage}", run_name="__main__", alter_sys=True)
    assert Path("data/tasks/pour/segments/metrics.json").exists()
    project.list_code()
    listed = Path("data/code/tasks/segment.txt").read_text()
    assert "structlearn/segmentation/alignment.py" in listed
    assert "own.yaml" not in listed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["new", "Pour it", "--from", "bags"], "'Pour it': a task's name has 1 to 60"),
        (["new", "pour", "--from", "bags"], "bags: no such file or folder"),
        (["new", "there", "--from", "there"], "there: already exists and is not empty"),
        (["run"], "structlearn.yaml: no such file here; `structlearn new` makes a project"),
        (["view", "pour"], "reports/tasks/pour/rerun: no recordings; make them first: structlearn run pour"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    Path("there").mkdir()
    Path("there/file").touch()
    with pytest.raises(SystemExit) as ended:
        command.main(words)
    assert ended.value.code == 1
    assert capsys.readouterr().err.startswith(f"error: {message}")
    assert {path.name for path in tmp_path.iterdir()} == {"there"}


def test_demonstrations_are_exported_once_they_are_cut(lab, monkeypatch, capsys):
    monkeypatch.chdir(lab)
    command.main(["export", "pour", "--to", "out", "--fps", "20", "--words", "pour water"])
    assert capsys.readouterr().out == "out: LeRobotDataset of 3 episodes\n"
    assert read_values("out/meta/info.json")["fps"] == 20
    for words, message in (
        (["pour", "--to", "out"], "out: already exists"),
        (["x"], "data/tasks/x/segments: does not exist"),
    ):
        with pytest.raises(SystemExit):
            command.main(["export", *words])
        assert capsys.readouterr().err.startswith(f"error: {message}")
