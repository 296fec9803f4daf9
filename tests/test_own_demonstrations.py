"""Tasks of one's own: entries, what stages make of recordings, and the documentation's three commands."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import EXAMPLE_TASK, ROOT, SETS, merged, own_tasks, run_stages
from conftest import minimum_jerk
from own_skills import quick_check
from readers_bags import as_recorded, pose_messages, write_bag
from reduced_pipeline import environment

from dissertation.simulation.pick_and_place import as_recording, takes, write_takes
from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import read_provenance, read_skill
from structlearn.primitives.fitting import learn_sequence
from structlearn.readers import read_recordings, synchronise, write_recordings
from structlearn.reporting.document import words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.segmentation.segments import cut
from structlearn.tasks.project import ENTRIES, STAGES, packaged_pipeline, write_project
from structlearn.tasks.task_entry import PARTS, read_checked, read_task, source_digests, write_task
from structlearn.tasks.task_files import NAME_RULE, TaskFiles

LEARNING = ("import_task", "segment", "primitives", "feedback", "skill", "check")
QUICK = {"fit": {"kernel_count": 10}, "feedback": {"training": {"steps": 60, "evaluate_every": 30}}}
REACH = {"source": "bags", "topics": {"pose": "/arm/pose"}, "segment": {"primitives": ["reach"]}}


CORRECTED = {
    "executions": "runs",
    "corrections": "corrected",
    "settings": [5],
    "primitives": ["reach"],
    "axes": ["x"],
}


def write_reach(path: Path, duration: float, rest: float, repeats: int = 0) -> None:
    """A reach, or a session of several, there and back again."""
    moves = range(max(2 * repeats, 1))
    time = np.arange(0.0, len(moves) * (duration + rest) + rest, 1 / 250)
    way = sum((-1) ** k * minimum_jerk((time - rest) / duration - k * (1 + rest / duration)) for k in moves)
    position = way[:, None] * [0.3, 0.2, 0.0] + (way * (1 - way))[:, None] * [0.0, 0.0, 0.2]
    identity = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    stamps = (10**9 + np.round(1e9 * time).astype(np.int64)).tolist()
    write_bag(path, pose_messages(stamps, np.hstack([position, identity]), "/arm/pose"))


@pytest.fixture(scope="module")
def bags(tmp_path_factory) -> Path:
    """Three bags with a reach each."""
    bags = tmp_path_factory.mktemp("bags")
    for number, (duration, rest) in enumerate([(1.0, 0.5), (1.3, 0.7), (0.8, 0.4)], start=1):
        write_reach(bags / f"take_{number}.mcap", duration, rest)
    return bags


@pytest.fixture
def folder(bags, tmp_path, monkeypatch) -> Path:
    """An empty project with a task `reach` of three bags."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(bags, "bags")
    own_tasks(tmp_path, QUICK, reach=REACH)
    return tmp_path


def readme(root: Path, language: str, place: int = 0) -> str:
    """A block of code of the page on your own data."""
    section = (root / "docs/own-data.md").read_text()
    return re.findall(rf"```{language}\n(.*?)```", section, re.DOTALL)[place]


def test_a_task_goes_through_to_its_page(root, folder):
    """There and back, once or several times in a recording: each is a demonstration of its own."""
    for number, repeats in enumerate((3, 1, 2), start=1):
        write_reach(Path(f"bags/take_{number}.mcap"), 1.0 + 0.1 * number, 0.6, repeats)
    own_tasks(folder, QUICK, reach=REACH | {"repeats": "auto", "segment": {"primitives": ["reach", "back"]}})
    run_stages("reach", *LEARNING, "view", "report")
    report = Path("reports/tasks/reach")
    values = json.loads((report / "metrics.json").read_text())
    assert (values["cuts_demonstrations"], values["cuts_warnings"]) == (6, 0)
    assert values["primitives_reach_left_out_mm"] < 5.0
    page = (report / "index.html").read_text()
    assert 'class="badge"' not in page  # nothing on it is simulated
    assert words_in_view(page) <= 1500
    assert "6 repeats of the task were found in 3 recordings" in page
    assert "take_1-03" in page
    assert sorted(read_csv(report / "tables/quality.csv")["rank"]) == list(range(1, 7))
    linked = {link.split("#")[0] for link in re.findall(r'(?:src|href)="([^"]*)"', page)} - {""}
    beside = [one for one in linked if not one.startswith(("../..", "https://doi.org"))]
    assert all((report / one).exists() for one in beside)
    skill = read_skill("data/tasks/reach/skill/skill.safetensors")
    assert [primitive.name for primitive in skill.primitives] == ["reach", "back"]
    assert (skill.workspace.high - skill.workspace.low > [0.39, 0.29, 0.1]).all()  # with 5 cm around
    read = read_provenance("data/tasks/reach/skill/skill.safetensors")["bags"]["demonstrations"]
    assert list(read) == [f"bags/take_{number}.mcap" for number in (1, 2, 3)]


def test_what_is_in_a_source_counts_and_nothing_else_changes_what_the_import_wrote(root, folder):
    parameters, recording = (
        Path(f"data/tasks/reach/{name}") for name in ("parameters.yaml", "recorded/demonstrations.parquet")
    )
    run_stages("reach", "import_task")
    once = parameters.read_bytes(), recording.read_bytes()
    own_tasks(folder, QUICK, reach=REACH, other=REACH | {"source": "elsewhere"})
    run_stages("reach", "import_task")
    assert (parameters.read_bytes(), recording.read_bytes()) == once
    write_reach(Path("bags/take_2.mcap"), 0.9, 0.5)
    run_stages("reach", "import_task")
    assert parameters.read_bytes() != once[0]
    assert recording.read_bytes() != once[1]


def test_a_recording_that_cannot_be_read_stops_the_others_unless_failures_are_skipped(root, folder, capsys):
    damaged = Path("bags/take_2.mcap")
    damaged.write_bytes(damaged.read_bytes()[:-5000])
    with pytest.raises(SystemExit):
        run_stages("reach", "import_task")
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line]
    assert line.startswith("error: ")
    assert "bags/take_2.mcap" in line
    own_tasks(folder, QUICK, reach=merged(REACH, {"segment": {"skip_failures": True}}))
    run_stages("reach", "import_task")
    files = TaskFiles("reach")
    assert [run.name for run in files.runs("demonstrations")] == ["take_1", "take_3"]
    assert files.left_out()["file"].tolist() == ["bags/take_2.mcap"]


def test_a_source_that_changes_while_it_is_read_is_refused(folder):
    task = read_task("reach")
    before = source_digests(task)
    write_reach(Path("bags/take_2.mcap"), 0.9, 0.5)
    with pytest.raises(InputError, match=r"take_2\.mcap: changed while it was read"):
        write_task(task, before, Path("parameters.yaml"))


def test_parts_that_an_entry_does_not_name_are_null(root, folder):
    task = read_task("reach")
    assert task.kind == "movement"
    assert all(getattr(task, part, None) is None for part in PARTS if part not in REACH)
    assert task.segment.primitives[0].name == "reach"
    own_tasks(folder, kind="motion", lab={"source": "logs", "urdf": "arm.urdf"})
    task = read_task("lab")
    assert (task.kind, task.rate_hz, task.load) == ("motion", 200.0, None)
    pour = yaml.safe_load(readme(root, "yaml"))  # as every entry of the documentation is one
    own_tasks(folder, pour=merged(pour["pour"], yaml.safe_load(readme(root, "yaml", 5))))
    assert read_task("pour").feedback.settings == ("5", "tilt_left")
    ENTRIES.write_text(readme(root, "yaml", 6))
    assert [read_task(name).kind for name in ("arm", "skin", "table")] == ["motion", "touch", "obstacles"]


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (None, "structlearn.yaml: movement.task: is no mapping of parameters"),
        ({}, "structlearn.yaml: movement.task.source: Field required"),
        (REACH | {"feedback": {}}, "movement.task.feedback.executions"),
        (REACH | {"segmant": {}}, "movement.task.segmant: unknown parameter"),
        (REACH | {"topics": {}}, "movement.task.topics: needs a `pose`, or else `joint_states`"),
        (REACH | {"clock": {"rate_hz": -1}}, "movement.task.clock.rate_hz"),
        (REACH | {"repeats": 0}, "movement.task.repeats"),
        (
            REACH | {"presegmented": "reach", "repeats": 3},
            "repeats are looked for only where recordings are cut",
        ),
        (REACH | {"feedback": CORRECTED | {"primitives": ["raech"]}}, "no primitive 'raech' among reach"),
        (REACH | {"feedback": CORRECTED}, "movement.task: feedback.sensors: tactile is felt by no topic"),
    ],
)
def test_entries_that_are_none(folder, entry, words):
    own_tasks(folder, task=entry)
    with pytest.raises(InputError, match=re.escape(words)):
        read_task("task")


def test_parameters_that_no_import_wrote_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("structlearn.tasks.task_files.DATA", tmp_path)
    files = TaskFiles("pour")
    files.folder.mkdir()
    files.parameters.write_text("source: of an older version\n")
    for read in (lambda: files.has("robot"), lambda: files.kind):
        with pytest.raises(InputError, match=r"pour/parameters\.yaml: key '[\w.]+' is missing"):
            read()
    files.parameters.write_text("5\n")
    with pytest.raises(InputError, match=r"parameters\.yaml: key 'kind' is missing"):
        read_checked(files.parameters)


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        *(
            ("movement", name, r"^structlearn\.yaml: movement: .*: a task's name has 1 to 60")
            for name in ("a/b", "Pour", "-rf", "a" * 61, 1, True, None, 2.5)
        ),
        ("motion", "reach", r"movement\.reach: the name is taken: motion"),
    ],
)
def test_a_name_that_is_none_or_taken_is_one_line(folder, kind, name, message):
    ENTRIES.write_text(yaml.safe_dump({kind: {name: REACH}, "movement": {"reach": REACH, name: REACH}}))
    with pytest.raises(InputError, match=message):
        read_task("reach")


EVIL = (
    "x; touch PWNED", "$(touch PWNED)", "`touch PWNED`", "x' ; touch PWNED ; '", 'x" ; touch PWNED ; "',
    "x\ntouch PWNED", "-rf", "../../kept",
)  # fmt: skip
"""Names that a shell, a program or a path would make something else of."""

PYTHON = r"""#!/bin/sh
printf '%s|%s\0' "$DVC_STAGE" "$*" >> "$ASKED"
exit 1
"""
"""Stands in for `python` where DVC runs stages: notes what it is asked for, and fails."""


def test_dvc_runs_nothing_and_deletes_nothing_for_a_name_that_is_none(tmp_path):
    """Also by a plain `dvc repro`, of all tasks at once and before any other check."""
    project, asked, program = tmp_path / "project", tmp_path / "asked", tmp_path / "bin/python"
    project.mkdir()
    write_project(project, "", packaged_pipeline())
    own_tasks(project, **dict.fromkeys(EVIL, REACH))
    kept = project / "kept/recorded/1.mcap"
    kept.parent.mkdir(parents=True)
    kept.touch()
    program.parent.mkdir()
    program.write_text(PYTHON)
    program.chmod(0o755)
    variables = environment() | {"ASKED": str(asked), "PATH": f"{program.parent}:{os.environ['PATH']}"}
    dvc = f"{Path(sys.executable).parent}/dvc"
    subprocess.run([dvc, "init", "--quiet", "--no-scm"], cwd=project, env=variables, check=True)
    before = {path.name for path in project.iterdir()}
    command = [dvc, "repro", "--keep-going"]
    assert subprocess.run(command, cwd=project, env=variables, capture_output=True).returncode != 0
    stages, words = zip(*(line.split("|") for line in asked.read_text().split("\0")[:-1]), strict=True)
    assert {f"import_movement@{name}" for name in EVIL} == set(stages)
    assert set(words) == {"-m structlearn.tasks.stages.import_task"}
    assert {path.name for path in project.iterdir()} - {"data", "reports", "dvc.lock"} == before
    assert not list(tmp_path.rglob("*PWNED*"))
    assert kept.exists()


@pytest.mark.parametrize("stage", [STAGES / "import_task.py", ROOT / "stages/recorded/recorded_report.py"])
def test_stages_refuse_a_name_that_is_none(tmp_path, monkeypatch, capsys, stage):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [stage.name])
    for name in EVIL:
        own_tasks(tmp_path, **{name: REACH})
        monkeypatch.setenv("DVC_STAGE", f"dvc.yaml:import_movement@{name}")
        with pytest.raises(SystemExit):
            runpy.run_path(str(stage), run_name="__main__")
        error = capsys.readouterr().err.strip()
        assert error.startswith("error: ")
        assert error.endswith(NAME_RULE)
    assert not list(tmp_path.rglob("*PWNED*"))


def test_commands_hold_nothing_that_a_user_named_and_stages_are_skipped_only_where_their_outs_are(root):
    """One without outs is up to date in every fresh clone, whatever is missing there."""
    for file in (root / "dvc.yaml", STAGES / "pipeline.yaml", SETS / "pipeline.yaml"):
        for name, stage in yaml.safe_load(file.read_text())["stages"].items():
            stage = stage.get("do", stage)
            assert "${" not in stage["cmd"], f"{file}: {name}"
            assert stage.get("outs") or stage.get("metrics") or stage.get("always_changed"), f"{file}: {name}"


def test_the_example_passes_its_own_check():
    """The whole way from its bags, without the stages between: its arm keeps all limits in every corner.

    Links are looked at every 0.1 s only: a touch between two looks would be missed.
    """
    task = EXAMPLE_TASK
    demonstrations = [synchronise(as_recording(take), task.clock.rate_hz, 0.2) for take in takes(1, 3, 6)]
    primitives = learn_sequence(demonstrations, cut(demonstrations, task.segment).results, task.fit)
    box = demonstrated_workspace([one.position for one in demonstrations], task.skill.workspace_margin_m)
    found = quick_check(ReactiveSkill(primitives, workspace=box), task.robot)
    assert (found.verdict, len(found.failing)) == ("yes", 0)
    assert found.metrics()["check_runs"] == 33


def test_executions_and_corrections_give_feedback(root, reduced_project, tmp_path, monkeypatch):
    """The simulated testbed's, as a robot would have recorded them: cut, felt, learned, bounded."""
    monkeypatch.chdir(tmp_path)
    raw = reduced_project / "data/raw/scraping"
    for kind in ("nominal", "unrolls", "corrections/5", "corrections/10"):
        write_recordings(as_recorded(read_recordings(raw / kind)), Path("bags") / kind)
    moves = [
        {"name": "down", "axis": "z", "threshold_m_s": 0.02},
        {"name": "turn", "axis": "between"},
        {"name": "scrape", "axis": "y", "threshold_m_s": 0.01},
    ]
    topics = {"pose": "/pose", "wrench": "/wrench", "tactile": ["/tactile/0", "/tactile/1"]}
    feedback = {"executions": "bags/unrolls", "corrections": "bags/corrections", "settings": [5.0]}
    feedback |= {"primitives": ["scrape"], "axes": ["z", "ry"], "sensors": ["tactile", "wrench"]}
    segment = {"primitives": moves, "guess_cutoff_hz": 2.0, "cut_cutoff_hz": 3.0, "crossing_weight": 2.0}
    own_tasks(
        tmp_path,
        QUICK,
        scraping={"source": "bags/nominal", "topics": topics, "segment": segment, "feedback": feedback},
    )
    run_stages("scraping", *LEARNING, "report")
    learned = read_skill("data/tasks/scraping/skill/skill.safetensors")
    assert set(learned.networks) == {"scrape"}
    assert learned.axes == ("z", "ry")
    assert learned.sensors == (("tactile", 38), ("wrench", 6))
    values = values_by_key(read_findings(Path("reports/tasks/scraping/findings.csv")))
    assert values["feedback_scrape_ry_nmse"] > 0.0
    page = Path("reports/tasks/scraping/index.html").read_text()
    assert "Feedback from corrections" in page
    scores = Path("reports/tasks/scraping/tables/feedback_scores.csv").read_text()
    assert "10,False" in scores  # a setting that was not named only tests


def test_the_commands_of_the_readme_run_as_they_stand(root, tmp_path):
    """But for the viewer, which needs a screen."""
    home, work = tmp_path / "home", tmp_path / "work"
    (home / "demonstrations").mkdir(parents=True)
    work.mkdir()
    write_takes(takes(7, 3, 3), home / "demonstrations")
    lines = [line.split("#")[0].strip() for line in readme(root, "sh").splitlines()]
    commands = [line for line in lines if not line.startswith("structlearn view")]
    assert len(commands) == len(lines) - 1 == 3
    caches = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")  # what is compiled already
    variables = environment() | {"HOME": str(home), "XDG_CACHE_HOME": caches}
    done = subprocess.run(
        ["bash", "-e", "-c", "\n".join(commands)], cwd=work, env=variables, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (work / "pour/reports/tasks/pour/index.html").stat().st_size
    assert {path.name for path in work.iterdir()} == {"pour"}
