"""The real pipeline, end to end, on reduced parameters in a temporary clone."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from reduced_pipeline import artefacts, clone, environment, repro


@pytest.fixture(scope="module")
def project(root, tmp_path_factory) -> Path:
    project = clone(root, tmp_path_factory.mktemp("clone"))
    repro(project)
    return project


def test_everything_is_there(project):
    written = artefacts(project)
    for path in (
        "data/raw/scraping/nominal/04.mcap",
        "data/segments/scraping/cuts.parquet",
        "data/primitives/scraping/primitives.safetensors",
        "data/raw/scraping/corrections/2.5/03.mcap",
        "data/feedback/scraping/models/pointwise.safetensors",
        "data/feedback/scraping/evaluation/scores.parquet",
        "data/feedback/scraping/refinement/rollouts.parquet",
        "data/raw/scraping/refined/after/10/01.mcap",
        "data/feedback/scraping/search/trials.parquet",
        "data/raw/obstacles/cylinder/03/03.mcap",
        "data/obstacles/evaluation/scores.parquet",
        "data/raw/dynamics/stand_in/log.mcap",
        "data/dynamics/tracking/scores.parquet",
        "data/servoing/models.safetensors",
        "data/servoing/servo/trials.parquet",
        "data/servoing/other_skins/trials.parquet",
        "reports/index.html",
        "reports/dynamics/index.html",
        "reports/dynamics/metrics.json",
        "reports/servoing/index.html",
        "reports/servoing/metrics.json",
        "reports/obstacles/index.html",
        "reports/obstacles/metrics.json",
        "reports/scraping/index.html",
        "reports/scraping/metrics.json",
    ):
        assert written[path]
    for testbed, count in {"scraping": 6, "obstacles": 4, "dynamics": 4, "servoing": 3}.items():
        assert len(list((project / "reports/recordings" / testbed).glob("*.rrd"))) == count
    assert json.loads((project / "reports/times/stages.json").read_text())
    assert not list(project.rglob(".publish-*"))


def test_nothing_is_done_again(project):
    assert repro(project) == []


def test_same_inputs_and_seed_give_the_same_bytes(root, project, tmp_path):
    """Without DVC, and all stages in one process, which spares the start of each."""
    again = clone(root, tmp_path)
    subprocess.run([sys.executable, "-c", ALL_BY_HAND], cwd=again, env=environment(), check=True)
    first, second = artefacts(project), artefacts(again)
    assert first.keys() == second.keys()
    assert [path for path in first if first[path] != second[path]] == []


def test_a_changed_parameter_reruns_only_what_depends_on_it(project):
    file = project / "params.yaml"
    before = file.read_text()
    parameters = yaml.safe_load(before)
    parameters["inspect_servoing"]["map_points"] = 100
    file.write_text(yaml.safe_dump(parameters, sort_keys=False))
    assert repro(project) == ["inspect_servoing"]
    file.write_text(before)
    repro(project)


def test_a_killed_stage_leaves_nothing_half_written(project):
    """Killed after its second table of three; what stood there before stays, the next run does the rest."""
    before = artefacts(project)
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_HALF_WAY, "stages/scraping/fit_primitives.py"],
        cwd=project, env=environment(), check=False,
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL
    kept = {path: data for path, data in artefacts(project).items() if ".publish-" not in path}
    assert kept == before
    repro(project, "--single-item", "--force", "fit_primitives")
    assert artefacts(project) == before
    assert not list(project.rglob(".publish-*"))


def test_a_killed_refinement_keeps_its_iterations(project):
    """Killed after the first iteration of the first primitive; the next run does only what is missing."""
    before = artefacts(project)
    script = "stages/scraping/refine.py"
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_AFTER_AN_ITERATION, script],
        cwd=project, env=environment(), check=False,
    )  # fmt: skip
    assert killed.returncode == -signal.SIGKILL
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


ALL_BY_HAND = """
import runpy, sys, yaml
for stage in yaml.safe_load(open("dvc.yaml"))["stages"].values():
    sys.argv = stage["cmd"].split()[1:]
    runpy.run_path(sys.argv[0], run_name="__main__")
"""


KILLED_HALF_WAY = """
import os, runpy, signal, sys
from structlearn import artefacts
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
