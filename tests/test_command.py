"""The command `structlearn`: a project of one's own, away from a clone."""

import runpy
import sys
import tempfile
from pathlib import Path

import pytest
import yaml
from committed import ROOT, SETS
from dvc.utils.serialize import parse_yaml
from hypothesis import assume, given
from hypothesis import strategies as st
from import_graph import SOURCES, packages

from dissertation.recorded import sets_project as recorded
from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn import __version__, command
from structlearn.core import code_digests
from structlearn.core.params import read_values
from structlearn.tasks import project
from structlearn.tasks.task_entry import read_entries, read_task, targets
from structlearn.tasks.task_files import is_name

FRAME_RATES = ("-5", "0", "201", "2000000000")


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
    assert targets() == [f"{stage}@pour" for stage in [*stages, "view_movement"]]
    assert (lab / ".dvc/config").exists()
    assert "/data/tasks" in (lab / ".gitignore").read_text()


def test_its_stages_run_from_the_package(lab, monkeypatch):
    monkeypatch.chdir(lab)
    monkeypatch.setattr(sys, "argv", ["stage"])
    for stage in ("import_task", "segment"):
        monkeypatch.setenv("DVC_STAGE", f"dvc.yaml:{stage}@pour")
        runpy.run_module(f"structlearn.tasks.stages.{stage}", run_name="__main__", alter_sys=True)
    assert Path("data/tasks/pour/segments/metrics.json").exists()


def test_an_update_of_the_package_changes_the_digest_of_its_folder_alone(tmp_path, monkeypatch):
    library = tmp_path / "structlearn"
    for folder in ("", "core", "tasks", "tasks/stages"):
        (library / folder).mkdir()
        (library / folder / "__init__.py").touch()
    for file in ("core/made.py", "tasks/page.jinja", "tasks/stages/params.yaml"):
        (library / file).touch()
    monkeypatch.setattr(code_digests, "LIBRARY", library)
    before = dict(code_digests.code_digests([library]))
    assert list(before) == ["structlearn", "core", "tasks", "tasks_stages"]
    for file, changed in (("tasks/page.jinja", {"tasks"}), ("tasks/stages/params.yaml", set())):
        (library / file).write_text("changed")
        now = dict(code_digests.code_digests([library]))
        assert {name for name in now if now[name] != before[name]} == changed
        before = now


def parts(name: str) -> list[str]:
    """Modules of its kind that a stage over tasks runs."""
    kind = name.rpartition("_")[2]
    if name.startswith("report_"):
        return [f"{kind}.page", f"{kind}.parameters"]
    return [f"{kind}.view" if name.startswith("view_") else f"{kind}.learning"]


@pytest.mark.parametrize("home", [project.packaged_pipeline, (SETS / "pipeline.yaml").read_text])
def test_stages_depend_on_the_packages_that_they_import(home):
    stages = yaml.safe_load(home())["stages"]
    for name, stage in stages.items():
        stage = stage.get("do", stage)
        script = (
            stage["cmd"]
            .removeprefix("python ")
            .removeprefix("../../")
            .removeprefix("-m structlearn.tasks.stages.")
        )
        files = [ROOT / script if script.endswith(".py") else project.STAGES / f"{script}.py"]
        kinds = SETS if home is not project.packaged_pipeline else project.STAGES.parent
        if files[0].stem in ("learn", "report", "view"):
            files += [kinds / f"{part.replace('.', '/')}.py" for part in parts(name)]
        if stage.get("always_changed"):
            continue
        houses = (code_digests.LIBRARY, SOURCES / "dissertation")
        used = {
            code_digests.code_key(one, house)
            for one in packages(*files)
            for house in houses
            if one.is_relative_to(house)
        }
        params = {file: keys for one in stage["params"] for file, keys in one.items()}
        assert sorted(used) == sorted(params[".structlearn.yaml"]), name


def test_every_public_set_has_its_stages(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    project.write_project(tmp_path, (SETS / "public.yaml").read_text(), recorded.HEADER)
    Path("dvc.yaml").write_text(yaml.safe_dump(recorded.pipeline(), sort_keys=False))
    for name, one in read_entries().items():
        short = one.kind.rpartition(".")[2]
        asked = targets(name)
        assert asked[0] == f"import_{short}@{name}"
        assert f"report_{short}@{name}" in asked
    stages = read_values("dvc.yaml")["stages"]
    assert {stage["do"]["cmd"] for name, stage in stages.items() if name.startswith("report_")} == {
        "python ../../stages/recorded/report.py"
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["new", "Pour it", "--from", "bags"], "'Pour it': a task's name has 1 to 60"),
        (["new", "pour", "--from", "bags"], "bags: no such file or folder"),
        (["new", "there", "--from", "there"], "there: already exists and is not empty"),
        (["new", "1e3", "--from", "there"], "'1e3': a task's name has 1 to 60"),
        (
            ["new", "lab/data/grasp", "--from", "there"],
            "lab/data/grasp: is inside of a project; add an entry to",
        ),
        (["run"], "structlearn.yaml: no such file here; `structlearn new` makes a project"),
        (["view", "pour"], "structlearn.yaml: no such file here; `structlearn new` makes a project"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    for file in ("there/file", "lab/structlearn.yaml"):
        Path(file).parent.mkdir(parents=True)
        Path(file).touch()
    with pytest.raises(SystemExit) as ended:
        command.main(words)
    assert ended.value.code == 1
    said = capsys.readouterr().err
    assert said.startswith(f"error: {message}")
    assert said.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"there", "lab"}
    assert len(list(tmp_path.rglob("*"))) == 4


@pytest.mark.parametrize("words", ["check x", "view x", "export x", "run x", "excite --task x"])
def test_an_unknown_task_is_named_beside_those_there_are(lab, monkeypatch, capsys, words):
    monkeypatch.chdir(lab)
    with pytest.raises(SystemExit):
        command.main(words.split())
    assert capsys.readouterr().err == "error: structlearn.yaml: x: there is no such task among pour\n"


@pytest.mark.parametrize("name", ["check", "export"])
def test_what_is_for_movements_is_refused_for_other_kinds(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    Path("structlearn.yaml").write_text("motion: {arm: {source: log.csv, urdf: arm.urdf}}")
    with pytest.raises(SystemExit):
        command.main([name, "arm"])
    assert capsys.readouterr().err == "error: structlearn.yaml: motion.arm: is not a movement\n"


@pytest.mark.parametrize(
    "error", [OSError(30, "Read-only file system"), PermissionError(13, "Permission denied")]
)
def test_a_folder_that_cannot_be_written_is_named_before_dvc_starts(lab, monkeypatch, capfd, error):
    def refuse(*_, **__):
        raise error

    monkeypatch.chdir(lab)
    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    with pytest.raises(SystemExit) as ended:
        command.main(["run"])
    assert ended.value.code == 1
    assert capfd.readouterr() == ("", f"error: {lab}: cannot be written: {error.strerror}\n")


def test_a_command_leaves_the_working_directory_alone(tmp_path, monkeypatch):
    there = []

    def look(given):
        """Look at the folder while the command runs."""
        there.extend(tmp_path.iterdir())

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["bin/structlearn", "defaults"])
    monkeypatch.setattr(command, "defaults", look)
    command.main(["defaults"])
    assert not there


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"structlearn {__version__}\n"


@pytest.mark.parametrize(
    "name", ["1e3", "1e-3", "12", "1_000", "0x10", "0o17", "010", "2026-01-02", "yes", "off", "null", "true"]
)
def test_names_that_yaml_reads_as_something_else_are_refused(name):
    assert not is_name(name)


@given(st.from_regex(r"[0-9a-z][0-9_ebox-]{0,12}|[a-z]{1,5}", fullmatch=True))
def test_dvc_reads_an_allowed_name_as_written(name):
    assume(is_name(name))
    assert parse_yaml(f"{name}: x", "structlearn.yaml") == {name: "x"}


@pytest.mark.parametrize("name", ["pick", "2nd", "3d-print", "1e3x", "0xg", "no-1", "e3"])
def test_other_names_are_allowed(name):
    assert is_name(name)


def test_kinds_without_entries_may_be_left_out(lab, monkeypatch):
    monkeypatch.chdir(lab)
    entries = read_values("structlearn.yaml")
    assert set(entries) == {"movement"}
    from dvc.repo import Repo

    with Repo() as repo:
        stages = {stage.addressing for stage in repo.stage.collect()}
    assert {f"{stage}@pour" for stage in ("import_movement", "check")} < stages


def test_demonstrations_are_exported_once_they_are_cut(lab, monkeypatch, capsys):
    monkeypatch.chdir(lab)
    command.main(["export", "pour", "--to", "out", "--fps", "20", "--words", "pour water"])
    assert capsys.readouterr().out == "out: LeRobotDataset of 3 episodes\n"
    assert read_values("out/meta/info.json")["fps"] == 20
    at_most = "give 1 to 200, the clock's rate, above which frames are only interpolated"
    for words, message in (
        (["pour", "--to", "out"], "out: already exists"),
        *((["pour", "--fps", fps], f"pour: {fps} frames per second: {at_most}\n") for fps in FRAME_RATES),
    ):
        with pytest.raises(SystemExit):
            command.main(["export", *words])
        assert capsys.readouterr().err.startswith(f"error: {message}")
