"""The documentation's snippets: those in Python run, and the commands in shells are there."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from committed import ROOT, read_yaml
from own_skills import FIT, pick_skill, slower
from test_segmentation_strokes import SEGMENT, wiped

from structlearn import command
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives.fitting import learn_sequence
from structlearn.primitives.primitive_files import write_primitives
from structlearn.primitives.sequence import default_start
from structlearn.segmentation.segments import cut

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TARGETS = set(re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split())


def snippets(page: Path, *languages: str) -> list[str]:
    """Blocks of code of a page."""
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
    return [text for language, text in blocks if language in languages]


def ran(page: str, place: int = 0, **names):
    """The names of a page's snippet in Python after it ran."""
    exec(compile(snippets(ROOT / "docs" / page, "python")[place], page, "exec"), names)
    return names


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_primitives_unroll_as_getting_started_says():
    reach, retreat = pick_skill().primitives
    written = [reach, replace(retreat, name="carry"), replace(reach, name="retreat")]
    write_primitives(written, Path("data/primitives/scraping/primitives.safetensors"))
    path = ran("getting-started.md")["path"]
    assert path.position.position.shape == (8 * 300 + 1, 3)
    assert path.orientation.orientation.shape == (8 * 300 + 1, 4)


def test_the_loop_of_the_page_on_robots_follows_to_the_end():
    skill = slower(pick_skill(), 0.2)
    write_skill(skill, Path("data/feedback/scraping/skill.safetensors"), {})
    start, followed = default_start(skill.primitives), []
    given = {"position": start.position, "orientation": start.orientation, "counts": None}
    ran("robot.md", follow=lambda position, *_: followed.append(position.copy()), **given)
    assert followed[-1] == pytest.approx(skill.primitives[-1].position.goal, abs=5e-3)


def test_a_goal_and_a_point_on_the_way_are_given_as_the_page_on_robots_says():
    skill = slower(pick_skill(), 0.2)
    controller, start = Controller(skill, 1000.0), default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    goal, halfway = (skill.primitives[at].position.goal + 0.01 for at in (1, 0))
    ran("robot.md", 1, controller=controller, goal=goal, point=0.5 * (goal + halfway))
    while not controller.finished:
        controller.tick(None)
    assert controller.position == pytest.approx(goal, abs=5e-3)


def test_strokes_are_repeated_as_the_page_on_own_data_says():
    runs = wiped()
    workspace = demonstrated_workspace([run.position for run in runs], 0.05)
    learned = ReactiveSkill(learn_sequence(runs, cut(runs, SEGMENT).results, FIT), workspace=workspace)
    write_skill(learned, Path("skill.safetensors"), {})
    ended = ran("own-data.md", read_skill=read_skill, replace=replace, skill=learned)
    before, after = (skill.primitives[1].position.local for skill in (learned, ended["skill"]))
    assert after.rhythm.cycles == 5.5
    assert after.duration / 5.5 == pytest.approx(before.duration / before.rhythm.cycles)
    asked = {"clean": lambda camera: False, "camera": None, "Controller": Controller}
    controller = ran("own-data.md", 1, skill=learned, **asked)["controller"]
    assert controller.skill.primitives[1].rhythm.cycles == 50.0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_targets_commands_stages_and_scripts_of_shells_are_there(page):
    stages = set(read_yaml(ROOT / "dvc.yaml")["stages"])
    for text in snippets(page, "sh", "bash"):
        for line in text.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|;|\|", line.split(" #")[0]):
                words = [word for word in shlex.split(part) if "=" not in word] or [""]
                match words:
                    case ["make", *targets]:
                        assert set(targets) <= TARGETS, line
                    case ["structlearn", name, *_] if not name.startswith("-"):
                        assert callable(getattr(command, name)), line
                    case ["dvc", "repro", *named]:
                        assert set(named) <= stages, line
                    case ["python" | "pytest", file, *_] if not file.startswith("-"):
                        assert (ROOT / file).exists(), line
