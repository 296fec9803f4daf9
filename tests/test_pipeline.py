"""The real pipeline, end to end, on reduced parameters in a temporary clone."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

REDUCED = {
    "simulate": {"count": 4},
    "segment_sweep": {"noise_mm": [0.0, 0.5], "seeds": 2, "downsampling": [1, 8]},
    "fit_primitives": {"kernel_count": 15},
    "expected_traces": {"runs": 2},
    "record_corrections": {"settings_deg": [2.5, 5, 10], "runs": 3},
    "coupling_dataset": {"settings_deg": [2.5, 10]},
    "train_feedback": {"pointwise": {"steps": 200}, "unrolled": {"steps": 20}},
    "compare_models": {"steps": 60, "evaluate_every": 20},
    "time_controller": {"ticks": 200, "runs": 1},
    "evaluate_feedback": {"settings_deg": [0, 2.5, 10], "runs": 1},
    "refine": {
        "settings_deg": [2.5, 5],
        "training": {"steps": 40, "evaluate_every": 20},
        "iterations": 1,
        "evaluation_runs": 1,
        "added_runs": 2,
        "search": {"samples": 3},
    },
    "evaluate_refinement": {"settings_deg": [0, 5, 10], "runs": 1},
    "compare_search": {"budget": 14, "seeds": 1, "evaluation_runs": 1},
    "obstacle_scene": {"settings": 3},
    "obstacle_demonstrator": {"baseline_count": 3, "count": 3},
    "obstacle_training": {
        "per_setting": {"training": {"iterations": 3}},
        "per_shape": {"members": 2, "training": {"iterations": 3}},
        "all_shapes": {"training": {"iterations": 2}},
        "phase_modulated": {"steps": 40, "evaluate_every": 20, "chunk_samples": 20},
        "phase_modulated_hidden": [8],
    },
    "obstacle_evaluation": {"speeds_m_s": [0.1], "pairs": 4},
    "inspect_obstacles": {"scenarios": ["sphere/01", "cylinder/02"]},
    "arm_motion": {"duration_s": 24.0},
    "train_dynamics": {
        "seeds": 2,
        "learning": {"hidden": [4, 4]},
        "epochs": {"raw": 2, "normalised": 1, "robot": 1},
    },
    "online": {"seeds": 1, "learning": {"hidden": [4, 4]}, "payload": {"iterations": 3}},
    "track": {"seeds": 1, "reaching": {"goals": 1, "move_s": 1.0}},
    "toucher": {"areas": 2, "rotations": 2, "translations": 2},
    "geodesics": {"bin_size": 300, "bins": 1, "bridge_mm": 8.0},
    "train_latent": {
        "seeds": 2,
        "stacks": 1,
        "training": {"steps": 20, "batch_size": 16, "evaluate_every": 10},
        "pair_pool": 1000,
        "evaluation_pairs": 100,
    },
    "servo": {"trials": 3, "duration_s": 1.0, "shown": 1},
    "other_skins": {
        "skins": {"sphere": {"along_mm": [-10.0, 10.0], "across_deg": 60.0}},
        "seeds": 1,
        "steps": 10,
    },
    "inspect_servoing": {"demonstrations": ["rotation_1_1", "translation_1_1"], "trials": 1},
    "recorded_reaches": {"noise_mm": [0.5, 2.0], "seeds": 2},
    "recorded_corrections": {"splits": 2},
    "recorded_avoidance": {
        "folds": 2,
        "network": {"hidden": [6], "members": 2, "training": {"iterations": 5}},
        "pmnn": {"steps": 60, "evaluate_every": 30},
    },
    "recorded_dynamics": {"iterations": 5, "seeds": 1, "epochs": 1},
    "recorded_latent_touch": {
        "folds": 2,
        "simulated_repeats": 1,
        "geodesics": {"bin_size": 300, "bins": 1, "bridge_mm": 8.0},
        "spaces": {
            "seeds": 1,
            "training": {"steps": 5, "batch_size": 16},
            "pair_pool": 1000,
            "evaluation_pairs": 100,
        },
    },
}


NOT_REPEATABLE = (".gitignore", "timings.json", "stages.json")


def clone(root: Path, target: Path) -> Path:
    """The project's files as git sees them, with uncommitted changes, in a repository of their own.

    Locks are of other results: DVC would read and write their thousands of lines at every stage.
    """
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root, check=True, capture_output=True, text=True,
    ).stdout.split("\0")  # fmt: skip
    for name in filter(None, listed):
        if (root / name).is_file() and not name.endswith("dvc.lock"):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, target / name)
    parameters = yaml.safe_load((target / "params.yaml").read_text())
    for key, values in REDUCED.items():
        parameters[key].update(values)
    (target / "params.yaml").write_text(yaml.safe_dump(parameters, sort_keys=False))
    subprocess.run(["git", "init", "--quiet"], cwd=target, check=True)
    return target


def environment() -> dict[str, str]:
    """The environment in which `python` and `dvc` are those of the tests."""
    return {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def repro(project: Path, *options: str, **variables: str) -> list[str]:
    """Run `dvc repro`; returns the stages that it ran."""
    command = [sys.executable, "-m", "dvc", "repro", *options]
    done = subprocess.run(command, cwd=project, env=environment() | variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return [line.split("'")[1] for line in done.stdout.splitlines() if line.startswith("Running stage")]


def artefacts(project: Path) -> dict[str, bytes]:
    """All that the pipeline wrote, by path, but wall times and recordings for the viewer (random ids)."""
    files = [*(project / "data").rglob("*"), *(project / "reports").rglob("*")]
    return {
        file.relative_to(project).as_posix(): file.read_bytes()
        for file in files
        if file.is_file() and file.suffix != ".rrd" and file.name not in NOT_REPEATABLE
    }


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
    parameters["generalise"]["duration_factor"] = 2.0
    file.write_text(yaml.safe_dump(parameters, sort_keys=False))
    ran = repro(project)
    file.write_text(before)
    repro(project)
    assert "fit_primitives" in ran
    assert not {"record", "segment", "segment_sweep"} & set(ran)


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


def test_recorded_data_have_a_pipeline_of_their_own(project, recorded_data):
    ran = repro(project, "stages/recorded/dvc.yaml", RECORDED_DATA=str(recorded_data.resolve()))
    stages = {stage.split(":")[-1] for stage in ran}
    assert {
        "import_recordings",
        "reaches",
        "corrected_reaches",
        "unscrewing",
        "scraping",
        "slides",
        "avoidance",
        "dynamics",
        "latent_touch",
    } <= stages
    assert {"inspect", "report"} <= stages
    values = json.loads((project / "reports/recorded/metrics.json").read_text())
    assert values["reach_cut_error_ms_2mm"] <= 40.0
    recordings = {path.stem for path in (project / "reports/recordings/recorded").glob("*.rrd")}
    assert {"reaches", "corrected_reaches", "unscrewing", "scraping_recorded", "slides"} <= recordings
    again = repro(project, "stages/recorded/dvc.yaml", RECORDED_DATA=str(recorded_data.resolve()))
    assert [stage.split(":")[1] for stage in again] == ["import_recordings"]  # it always looks


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
