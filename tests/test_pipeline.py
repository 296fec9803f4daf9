"""The real pipeline, end to end, on reduced parameters in a temporary clone."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from reduced_pipeline import artefacts, clone, environment, repro

CUTTING = ["record_nominal", "segment", "fit_primitives"]
"""Stages on which DVC itself is tried; the others run in one process without it, to spare their starts."""


@pytest.fixture(scope="module")
def project(root, tmp_path_factory) -> Path:
    return all_by_hand(clone(root, tmp_path_factory.mktemp("clone")))


@pytest.fixture(scope="module")
def watched(root, tmp_path_factory) -> Path:
    """A project whose first stages DVC has run."""
    project = clone(root, tmp_path_factory.mktemp("watched"))
    (project / "reports/times/stages.json").unlink()  # it is kept in git; here it must be made anew
    assert repro(project, CUTTING[-1]) == CUTTING
    return project


def all_by_hand(project: Path, **variables: str) -> Path:
    """Every stage of the main pipeline in order, in one process."""
    subprocess.run(
        [sys.executable, "-c", ALL_BY_HAND], cwd=project, env=environment() | variables, check=True
    )
    return project


def test_everything_is_there(project):
    stages = yaml.safe_load((project / "dvc.yaml").read_text())["stages"]
    for stage in stages.values():
        for out in [*stage.get("outs", []), *stage.get("metrics", [])]:
            path = project / (out if isinstance(out, str) else next(iter(out)))
            assert path.stat().st_size, path
    for testbed, count in {"scraping": 6, "obstacles": 4, "dynamics": 4, "servoing": 3}.items():
        assert len(list((project / "reports/recordings" / testbed).glob("*.rrd"))) == count
        values = json.loads((project / "reports" / testbed / "metrics.json").read_text())
        assert sum(values[f"claims_{word}"] for word in ("yes", "no", "undecided", "not_tested"))
    assert not list(project.rglob(".publish-*"))


def test_pages_name_only_files_that_are_there(project):
    made = [project / "reports" / testbed for testbed in ("scraping", "obstacles", "dynamics", "servoing")]
    for page in [
        project / "reports/index.html",
        *(page for folder in made for page in folder.glob("*.html")),
    ]:
        for link in page.read_text().replace('src="', 'href="').split('href="')[1:]:
            target = link.split('"')[0].split("#")[0]
            elsewhere = target.startswith(("../recorded", "recorded", "calibration", "ablations", "times"))
            if target and not elsewhere:
                assert (page.parent / target).exists(), f"{page}: {target}"


def test_same_inputs_and_seed_give_the_same_bytes(root, project, tmp_path):
    """Also with another number of processes and another order of hashes."""
    again = all_by_hand(clone(root, tmp_path), STRUCTLEARN_PROCESSES="1", PYTHONHASHSEED="7")
    first, second = artefacts(project), artefacts(again)
    assert first.keys() == second.keys()
    assert [path for path in first if first[path] != second[path]] == []


def test_dvc_makes_the_same_and_keeps_the_times(watched, project):
    made, by_hand = artefacts(watched), artefacts(project)
    assert {path: data for path, data in made.items() if path.startswith("data")}.items() <= by_hand.items()
    assert set(json.loads((watched / "reports/times/stages.json").read_text())) == {
        f"stages/scraping/{name}.py" for name in CUTTING
    }


def test_nothing_is_done_again(watched):
    assert repro(watched, CUTTING[-1]) == []


def test_a_changed_parameter_reruns_only_what_depends_on_it(watched):
    file = watched / "params.yaml"
    before = file.read_text()
    parameters = yaml.safe_load(before)
    parameters["fit_primitives"]["kernel_count"] += 1
    file.write_text(yaml.safe_dump(parameters, sort_keys=False))
    assert repro(watched, CUTTING[-1]) == ["fit_primitives"]
    file.write_text(before)


def test_rewording_a_page_makes_only_that_page_again(watched):
    """Of all stages, those that depend on the folder of the template; and the front page after them."""
    template = "src/structlearn/testbeds/obstacles/page"
    stages = yaml.safe_load((watched / "dvc.yaml").read_text())["stages"]
    assert [name for name, stage in stages.items() if template in stage["deps"]] == ["report_obstacles"]


def test_a_killed_stage_leaves_nothing_half_written(project):
    """Killed after its second table of three; what stood there before stays, the next run does the rest."""
    before = artefacts(project)
    script = "stages/scraping/fit_primitives.py"
    assert killed(project, KILLED_HALF_WAY, script) == -signal.SIGKILL
    kept = {path: data for path, data in artefacts(project).items() if ".publish-" not in path}
    assert kept == before
    subprocess.run([sys.executable, script], cwd=project, env=environment(), check=True)
    assert artefacts(project) == before
    assert not list(project.rglob(".publish-*"))


def test_a_killed_refinement_keeps_its_iterations(project):
    """Killed after the first iteration of the first primitive; the next run does only what is missing."""
    before = artefacts(project)
    script = "stages/scraping/refine.py"
    assert killed(project, KILLED_AFTER_AN_ITERATION, script) == -signal.SIGKILL
    unfinished = project / "data/unfinished"
    (kept,) = unfinished.iterdir()
    assert [path.name for path in sorted(kept.iterdir())] == ["000", "001"]
    done = subprocess.run(
        [sys.executable, script], cwd=project, env=environment(), capture_output=True, text=True, check=True
    )
    told = [line.split(":")[0] for line in done.stdout.splitlines() if "iteration" in line]
    assert told == ["scrape, iteration 0", "scrape, iteration 1"]
    assert not unfinished.exists()
    assert artefacts(project) == before


def killed(project: Path, code: str, script: str) -> int:
    """Exit code of a stage that kills itself on the way."""
    command = [sys.executable, "-c", code, script]
    return subprocess.run(command, cwd=project, env=environment(), check=False).returncode


ALL_BY_HAND = """
import runpy, sys, yaml
for stage in yaml.safe_load(open("dvc.yaml"))["stages"].values():
    sys.argv = stage["cmd"].split()[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
"""


KILLED_HALF_WAY = """
import os, runpy, signal, sys
from structlearn.ground import artefacts
write_table, calls = artefacts.write_table, []
def write_and_die(*arguments):
    write_table(*arguments)
    calls.append(arguments)
    if len(calls) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
artefacts.write_table = write_and_die
runpy.run_path(sys.argv[1], run_name="__main__")
"""


KILLED_AFTER_AN_ITERATION = """
import os, runpy, signal, sys
from structlearn.policy_search import checkpoint
save = checkpoint.Checkpoint.save
def save_and_die(self, progress):
    save(self, progress)
    if progress.iteration == 1:
        os.kill(os.getpid(), signal.SIGKILL)
checkpoint.Checkpoint.save = save_and_die
runpy.run_path(sys.argv[1], run_name="__main__")
"""
