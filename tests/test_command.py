"""The command `structlearn`: a project of one's own, away from a clone."""

import runpy
import shlex
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import ROOT, SETS
from dvc.utils.serialize import parse_yaml
from hypothesis import assume, given
from hypothesis import strategies as st
from import_graph import SOURCES, packages
from rigid_body_robots import joint, link

from dissertation.recorded import sets_project as recorded
from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn import __version__, command
from structlearn.core import code_digests
from structlearn.core.errors import InputError
from structlearn.core.params import read_values
from structlearn.readers.bag_recording import write_joint_log
from structlearn.readers.joint_log import JointLog
from structlearn.tasks import project
from structlearn.tasks.task_entry import add_entry, read_entries, read_task, targets
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


ENTRIES = """\
# my tasks
movement:   # of hands
    pour:
        source: a  # kept
        segment: {primitives: [reach]}
    # none below

touch: {}
motion: {arm: {source: log.csv, urdf: arm.urdf}}
"""


@pytest.mark.parametrize("kind", ["movement", "touch", "obstacles"])
def test_an_entry_is_added_below_its_kind_and_all_else_stays_as_it_was(tmp_path, kind):
    file = tmp_path / "structlearn.yaml"
    file.write_text(ENTRIES)
    add_entry(kind, "wipe", lambda: ["  wipe:", "    source: 'Käthe & 1'", "    repeats: auto"], file)
    text, wipe = file.read_text(), {"source": "Käthe & 1", "repeats": "auto"}
    before = yaml.safe_load(ENTRIES)
    assert yaml.safe_load(text) == before | {kind: (before.get(kind) or {}) | {"wipe": wipe}}
    kept = [line for line in ENTRIES.splitlines() if line and line != "touch: {}"]
    assert [line for line in text.splitlines() if line in kept] == kept


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("movement", "pour", "movement.pour: there is such a task already"),
        ("touch", "arm", "motion.arm: there is such a task already"),
        ("movement", "Wipe it", "'Wipe it': a task's name has"),
        ("motion", "other", "motion: is not written line by line"),
    ],
)
def test_what_cannot_be_added_leaves_the_file_alone(tmp_path, kind, name, message):
    file = tmp_path / "structlearn.yaml"
    file.write_text(ENTRIES)
    with pytest.raises(InputError, match=message):
        add_entry(kind, name, lambda: [f"  {name}:", "    source: b"], file)
    assert file.read_text() == ENTRIES


def test_a_task_is_added_as_a_new_one_is_proposed(lab, bags, tmp_path, monkeypatch, capsys):
    shutil.copy(lab / "structlearn.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    command.main(["add", "wipe", "--from", str(bags)])
    assert capsys.readouterr().out.endswith(
        "structlearn.yaml: look at movement.wipe, then: structlearn run wipe\n"
    )
    entries = yaml.safe_load(Path("structlearn.yaml").read_text())["movement"]
    assert entries["wipe"] == entries["pour"]
    assert read_task("wipe").source == str(bags)


AWKWARD = "Käthe's R&D <1>"


def test_what_is_printed_can_be_pasted_and_paths_are_written_as_they_are(tmp_path, monkeypatch, capsys):
    place = tmp_path / AWKWARD
    (place / "logs").mkdir(parents=True)
    (place / "arm.urdf").write_text(f'<robot name="r"><link name="base"/>{link("a")}{HINGE}</robot>')
    write_joint_log(wave(np.sin), place / "logs/1.mcap")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "_begin", lambda folder: None)
    words = ["--from", f"{AWKWARD}/logs", "--urdf", f"{AWKWARD}/arm.urdf"]
    command.main(["new", f"{AWKWARD}/arm", "--kind", "motion", *words])
    pasted = capsys.readouterr().out.rpartition("then: ")[2].strip()
    assert shlex.split(pasted) == ["cd", f"{AWKWARD}/arm", "&&", "structlearn", "run"]
    text = Path(AWKWARD, "arm/structlearn.yaml").read_text(encoding="utf-8")
    assert str(place / "logs") in text.replace("''", "'")
    assert yaml.safe_load(text)["motion"]["arm"] == {
        "source": str(place / "logs"),
        "urdf": str(place / "arm.urdf"),
    }


HINGE = joint("hinge", "revolute", "base", "a")


def wave(torque) -> JointLog:
    t = 0.01 * np.arange(300)
    signals = (shape(t)[:, None] for shape in (np.sin, np.cos, torque))
    return JointLog("log", ("hinge",), (1e9 * t).astype(np.int64), *signals)


@pytest.mark.parametrize(
    ("torque", "urdf", "message"),
    [
        (np.zeros_like, "arm.urdf", "the arm cannot be identified: all efforts are 0"),
        (np.ones_like, "arm.urdf", "the arm cannot be identified: no effort changes"),
        (np.sin, "", "an arm is identified with its URDF: give --urdf FILE"),
        (np.sin, "other.urdf", "there is no file 'other.urdf'"),
    ],
)
def test_an_arm_that_cannot_be_identified_gets_no_project(
    tmp_path, monkeypatch, capsys, torque, urdf, message
):
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(f'<robot name="r"><link name="base"/>{link("a")}{HINGE}</robot>')
    Path("logs").mkdir()
    write_joint_log(wave(torque), "logs/1.mcap")
    words = ["new", "arm", "--kind", "motion", "--from", "logs", *(["--urdf", urdf] if urdf else [])]
    with pytest.raises(SystemExit):
        command.main(words)
    assert message in capsys.readouterr().err
    assert not Path("arm").exists()


def test_the_examples_are_where_the_command_says(capsys):
    command.main(["examples"])
    assert {file.name for file in Path(capsys.readouterr().out.strip()).iterdir()} > {"learn_from_bags.py"}


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
