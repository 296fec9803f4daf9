"""The real pipeline, end to end, on reduced parameters in a temporary clone."""

import json
import re
import shutil
import signal
import subprocess
import sys
from contextlib import chdir
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
import yaml
from committed import read_yaml
from dvc.repo import Repo
from page_links import broken, links
from reduced_pipeline import (
    artefacts,
    by_hand,
    clone,
    digests,
    environment,
    read_digests,
    repro,
    same_libraries,
)
from viewer_files import contents, values, view_names

from structlearn.core.stage import TIMES, read_times
from structlearn.reporting.document import words_in_view

CUTTING = [
    *("scraping_record_nominal", "scraping_import_nominal"),
    *("scraping_segment", "scraping_fit_primitives"),
]
"""Stages on which DVC itself is tried."""

TEXT = "TextDocument:text"

TESTBEDS = {"scraping": 6, "obstacles": 4, "dynamics": 4, "servoing": 3}
"""With the number of their recordings."""

AGAIN = (
    *("scraping_sweep", "scraping_expected_traces", "scraping_compare_models", "obstacles_train"),
    *("dynamics_train", "dynamics_online", "dynamics_track"),
    *("servoing_geodesics", "servoing_train_latent", "servoing_servo"),
    *(f"{testbed}_report" for testbed in TESTBEDS),
)
"""Stages that spread their work over processes, each in its own way, and what is drawn of them."""


@pytest.fixture(scope="module")
def watched(root, tmp_path_factory) -> Path:
    """A project whose first stages DVC has run."""
    project = clone(root, tmp_path_factory.mktemp("watched"))
    assert repro(project, CUTTING[-1]) == CUTTING
    return project


@pytest.fixture
def copied(reduced_project, tmp_path) -> Path:
    """The finished project, to run stages in it again."""
    return Path(shutil.copytree(reduced_project, tmp_path / "copied", symlinks=True))


def test_everything_is_there(reduced_project):
    stages = read_yaml(reduced_project / "dvc.yaml")["stages"]
    for stage in stages.values():
        for out in [*stage.get("outs", []), *stage.get("metrics", [])]:
            path = reduced_project / (out if isinstance(out, str) else next(iter(out)))
            assert path.stat().st_size, path
    for testbed in TESTBEDS:
        values = json.loads((reduced_project / "reports" / testbed / "metrics.json").read_text())
        assert sum(values[f"claims_{word}"] for word in ("yes", "no", "undecided", "not_tested"))
    assert not list(reduced_project.rglob(".publish-*"))


@pytest.mark.parametrize("testbed", TESTBEDS)
def test_recordings_are_sound_and_say_what_is_simulated(reduced_project, testbed):
    recordings = list((reduced_project / "reports/rerun" / testbed).glob("*.rrd"))
    assert len(recordings) == TESTBEDS[testbed]
    for path in recordings:
        _, entities, timelines = contents(path)
        assert timelines <= {"time", "phase", "iteration", "demonstration", "sphere"}
        notes = [entity for entity in entities if entity.startswith("/notes")]
        assert notes
        assert any("imulated" in words for place in notes for words in values(path, place, TEXT)[0])
        assert view_names(path)


@pytest.mark.parametrize("testbed", ["", *TESTBEDS])
def test_pages_are_short_and_name_only_files_that_are_there(reduced_project, testbed):
    """And those of a testbed name every figure and table beside them, and load nothing from elsewhere."""
    folder = reduced_project / "reports" / testbed
    stages = read_yaml(reduced_project / "dvc.yaml")["stages"]
    linked = set()
    for page in folder.glob("*.html"):
        text = page.read_text()
        assert words_in_view(text) <= (1500 if testbed else 1000)
        assert set(re.findall(r"dvc repro ([a-z_]+)<", text)) <= set(stages)
        assert not re.search(r'src="(https?:)?//|<link\b', text)
        assert not re.search(
            r"\bnan\b", re.sub(r"<(style|script)>.*?</\1>|<[^>]*>", " ", text, flags=re.DOTALL)
        )
        not_made = tuple(
            reduced_project / "reports" / name for name in ("recorded", "studies", "reliability")
        )
        assert broken(page, not_made) == []
        linked |= links(page)
    for still in folder.glob("figures/*still*.png"):
        assert plt.imread(still).std() > 0.02  # not a void
    if testbed:
        assert {path.relative_to(folder).as_posix() for path in folder.glob("*s/*")} <= linked


@pytest.mark.skipif(not same_libraries(), reason="promised for x86-64 with AVX2 and glibc 2.36")
def test_every_processor_gives_the_same_bits(reduced_project):
    """Digests were committed by whoever ran `python -m reduced_pipeline` last, maybe on another processor."""
    assert digests(reduced_project) == read_digests()


def test_more_processes_give_the_same_bytes(reduced_project, copied):
    """And another order of hashes."""
    again = artefacts(by_hand(copied, AGAIN, spread=True, PYTHONHASHSEED="7"))
    once = artefacts(reduced_project)
    assert once.keys() == again.keys()
    assert [path for path in once if once[path] != again[path]] == []


def test_dvc_makes_the_same_and_keeps_the_times(watched, reduced_project):
    made, by_hand = artefacts(watched), artefacts(reduced_project)
    assert {path: data for path, data in made.items() if path.startswith("data")}.items() <= by_hand.items()
    stages = read_yaml(watched / "dvc.yaml")["stages"]
    assert set(read_times(watched / TIMES)) == {stages[n]["cmd"].removeprefix("python ") for n in CUTTING}


def test_a_changed_parameter_reruns_only_what_depends_on_it(watched):
    file = watched / "params.yaml"
    before = file.read_text()
    parameters = yaml.safe_load(before)
    parameters["fit_primitives"]["kernel_count"] += 1
    file.write_text(yaml.safe_dump(parameters, sort_keys=False))
    assert repro(watched, CUTTING[-1]) == CUTTING[-1:]
    file.write_text(before)
    assert repro(watched, CUTTING[-1]) == []  # nothing is done again


EDITS = {
    "stages/scraping/segment.py": {"scraping_segment"},
    "src/dissertation/obstacles/page/obstacles.html.jinja": {"obstacles_report"},
    "src/structlearn/policy_search/pi2.py": {
        *("scraping_refine", "scraping_evaluate_refinement", "scraping_compare_search"),
        *("scraping_results", "scraping_view", "scraping_report", "scraping_loop"),
    },
    "params.yaml": {
        *("scraping_segment", "scraping_sweep", "scraping_write_skill", "scraping_results", "scraping_view"),
        "engines",
        *(f"{testbed}_{shown}" for testbed in TESTBEDS for shown in ("report", "view")),
    },
}
"""By an edited file: the stages that are no longer up to date. The parameter is one that several share."""


@pytest.fixture(scope="module")
def up_to_date(reduced_project, tmp_path_factory) -> Path:
    """The finished project, whose stages DVC takes as it finds them."""
    project = Path(
        shutil.copytree(reduced_project, tmp_path_factory.mktemp("dvc") / "project", symlinks=True)
    )
    assert status(project) != {}
    subprocess.run([sys.executable, "-m", "dvc", "commit", "--force", "--quiet"], cwd=project, check=True)
    assert status(project) == {}
    return project


def status(project: Path, *stages: str) -> dict[str, list[object]]:
    """What `dvc status` says has changed, by stage, in this process, which has loaded DVC."""
    with chdir(project), Repo() as repo:
        return repo.status(targets=list(stages) or None)


@pytest.mark.parametrize("file", EDITS)
def test_status_and_single_stages_see_an_edit_at_once(up_to_date, file):
    """Of a script, a source, a template, a parameter; also if a single stage is asked for."""
    path = up_to_date / file
    text = path.read_text()
    path.write_text(
        text.replace("extension_s: ", "extension_s: 1") if path.suffix == ".yaml" else text + "\n"
    )
    assert set(status(up_to_date)) == EDITS[file]
    stage = min(EDITS[file])
    assert set(status(up_to_date, stage)) == {stage}
    assert repro(up_to_date, "--single-item", "--dry", stage) == [stage]
    path.write_text(text)


def test_a_killed_stage_leaves_nothing_half_written(reduced_project, copied):
    """Killed after its second table of three; what stood there before stays, the next run does the rest."""
    before = artefacts(reduced_project)
    assert killed(copied, KILLED_HALF_WAY, "stages/scraping/fit_primitives.py") == -signal.SIGKILL
    kept = {path: data for path, data in artefacts(copied).items() if ".publish-" not in path}
    assert kept == before
    assert artefacts(by_hand(copied, CUTTING[-1:])) == before
    assert not list(copied.rglob(".publish-*"))


def killed(project: Path, code: str, script: str) -> int:
    """Exit code of a stage that kills itself on the way."""
    command = [sys.executable, "-c", code, script]
    return subprocess.run(command, cwd=project, env=environment(), check=False).returncode


KILLED_HALF_WAY = """
import os, runpy, signal, sys
from structlearn.core import artefacts
write_table, calls = artefacts.write_table, []
def write_and_die(*arguments):
    write_table(*arguments)
    calls.append(arguments)
    if len(calls) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
artefacts.write_table = write_and_die
runpy.run_path(sys.argv[1], run_name="__main__")
"""
