"""The real pipeline on reduced parameters, in a clone of the project's files.

    PYTHONPATH=tests python -m reduced_pipeline

writes the digests of its data to `tests/reduced_digests.txt`, after a change that is meant to change results.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import yaml
from committed import merged, read_yaml

from dissertation.recorded.sets_project import FOLDER
from structlearn.core.parallel import BACKEND
from structlearn.tasks.project import ENTRIES

REDUCED = {
    "simulate": {"count": 4},
    "segment_sweep": {"noise_mm": [0.0, 0.5], "seeds": 2, "downsampling": [1, 8]},
    "fit_primitives": {"kernel_count": 15},
    "expected_traces": {"runs": 2, "level_runs": 1},
    "record_corrections": {"settings_deg": [2.5, 5, 10], "runs": 3},
    "coupling_dataset": {"settings_deg": [2.5, 10]},
    "train_feedback": {"pointwise": {"steps": 200}, "unrolled": {"steps": 20}},
    "compare_models": {"steps": 60, "evaluate_every": 20},
    "evaluate_feedback": {"settings_deg": [0, 2.5, 10], "runs": 1},
    "refine": {
        "settings_deg": [2.5, 5],
        "training": {"steps": 40, "evaluate_every": 20},
        "iterations": 1,
        "evaluation_runs": 1,
        "added_runs": 2,
        "shown_runs": 1,
        "level_runs": 1,
        "search": {"samples": 3},
    },
    "evaluate_refinement": {"settings_deg": [0, 5, 10], "runs": 1},
    "compare_search": {"budget": 13, "seeds": 1, "evaluation_runs": 1},
    "obstacle_people": {"tuning": [1], "test": [11, 12]},
    "obstacle_scene": {"settings": 2},
    "obstacle_demonstrator": {"baseline_count": 3, "count": 3},
    "obstacle_training": {
        "per_setting": {"training": {"iterations": 3}},
        "across_settings": {"training": {"iterations": 3}},
        "ensemble": {"members": 2, "training": {"iterations": 3}},
        "phase_modulated": {"steps": 40, "evaluate_every": 20, "chunk_samples": 8},
        "phase_modulated_hidden": [8],
    },
    "obstacle_evaluation": {"rate_hz": 25.0, "kept_every": 1, "speeds_m_s": [0.1], "pairs": 2},
    "inspect_obstacles": {"scenarios": ["sphere/01", "cylinder/02"]},
    "dynamics_robots": {"test": [11, 12]},
    "arm_motion": {"test": {"duration_s": 24.0}},
    "perturbed_robot": {"log_s": 16.0},
    "train_dynamics": {
        "seeds": [11, 12],
        "learning": {"hidden": [4, 4]},
        "epochs": {"simulation": 2, "robot": 1},
    },
    "online": {"seeds": [11], "payload": {"empty_s": 8.0, "iterations": 3}},
    "track": {"sine_s": 2.0, "reaching": {"goals": 1, "move_s": 1.0}},
    "toucher": {"seed": 1, "areas": 2, "rotations": 2, "translations": 2},  # its sets have every split
    "geodesics": {"bin_size": 300, "bins": 1, "bridge_mm": 8.0},
    "train_latent": {
        "seeds": 2,
        "stacks": 1,
        "start_steps": 5,
        "training": {"steps": 20, "batch_size": 16, "evaluate_every": 10},
        "pair_pool": 1000,
        "evaluation_pairs": 100,
    },
    "servo": {"trials": 3, "duration_s": 1.0, "shown": 1},
    "other_skins": {"seeds": 1},
    "inspect_servoing": {"demonstrations": ["rotation_1_1", "translation_1_1"], "trials": 1},
}

TRAINING = {"steps": 5, "batch_size": 16}
SPACES = {"seeds": 1, "training": TRAINING, "pair_pool": 1000, "evaluation_pairs": 100}
REDUCED_TASKS = {  # entries of public sets
    "movement": {"reaches": {"rests": {"noise_mm": [0.5, 2.0], "seeds": 2}, "corrections": {"splits": 5}}},
    "motion": {
        "panda": {"rate_hz": 100.0, "iterations": 5, "draws": 100, "networks": {"seeds": 1, "epochs": [1]}},
        "ur10e": {
            "rate_hz": 50.0,
            "iterations": 5,
            "body_draws": 3,
            "draws": 100,
            "networks": {"hidden": [[4]], "rates": [0.01], "epochs": [1], "choice_seeds": 1, "seeds": 1},
            "load": {"batch": 200, "iterations": 5},
        },
        "kuka_lwr4": {"iterations": 5, "draws": 100},
        "kuka_lwr4_differing": {"iterations": 5, "draws": 100},
    },
    "dissertation.recorded.parts": {"delan_characters": {"seeds": 2, "splits": 2, "epochs": 2}},
    "dissertation.recorded.transfer": {
        "biotac": {
            "simulated_repeats": 1,
            "geodesics": {"bin_size": 300, "bins": 1, "bridge_mm": 8.0},
            "spaces": SPACES,
        },
    },
    "touch": {
        "eflesh": {
            "folds": 2,
            "rival_samples": 100,
            "spaces": SPACES | {"evaluation_pairs": 1000},
            "servo": {"walks": 200, "trials": 4, "steps": 4},
            "published": {"first_share": 0.55, "epochs": 1},  # the Gaussian process takes by the cube of it
        },
    },
    "obstacles": {
        "boxes": {
            "folds": 2,
            "keep_every": 60,
            "cloud_count": 20,
            "reaches": {"samples": 51},
            "network": {"members": 1, "demonstrations": 20, "training": {"iterations": 3}},
            "published_network": {"training": {"iterations": 3}},
        },
    },
    "dissertation.recorded.coupling": {
        "avoidance": {
            "folds": 2,
            "network": {"members": 1, "training": {"iterations": 2}},
            "pmnn": {"steps": 20, "evaluate_every": 20},
        }
    },
}

NOT_REPEATABLE = (".gitignore", "times.json")


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
    parameters = merged(read_yaml(target / "params.yaml"), REDUCED)
    parameters["other_skins"]["skins"].pop("flat_pad")
    (target / "params.yaml").write_text(yaml.safe_dump(parameters, sort_keys=False))
    subprocess.run(["git", "init", "--quiet"], cwd=target, check=True)
    return target


def recorded_project(project: Path, source: Path) -> Path:
    """The project of public sets in a clone, on reduced parameters."""
    command = [sys.executable, "-m", "dissertation.recorded.sets_project"]
    variables = environment() | {"RECORDED_DATA": str(source.resolve())}
    subprocess.run(command, cwd=project, env=variables, check=True)
    entries = project / FOLDER / ENTRIES
    entries.write_text(yaml.safe_dump(merged(read_yaml(entries), REDUCED_TASKS), sort_keys=False))
    return project / FOLDER


def environment() -> dict[str, str]:
    """In which `python` and `dvc` are those of the tests, and work is spread as it is for a user."""
    kept = {name: value for name, value in os.environ.items() if name != BACKEND}
    return kept | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def by_hand(project: Path, stages: Iterable[str] | None = None, spread=False, **variables: str) -> Path:
    """Run stages (default all) in the order of their file in one process without DVC, to save their starts.

    Stages of tasks run for every one. `spread`: over processes; `variables`: of the environment.
    """
    listed, commands = read_yaml(project / "dvc.yaml")["stages"], []
    entries = read_yaml(project / ENTRIES) if (project / ENTRIES).exists() else {}
    for name, stage in listed.items():
        if stages is None or name in stages:
            over = stage.get("foreach", [""])
            tasks = entries[over[2:-1]] if isinstance(over, str) else over
            commands += [f"{stage.get('do', stage)['cmd']} {task}".strip() for task in tasks]
    alone = {} if spread else {BACKEND: "sequential"}
    command = [sys.executable, "-c", ONE_BY_ONE, *commands]
    subprocess.run(command, cwd=project, env=environment() | alone | variables, check=True)
    return project


ONE_BY_ONE = """
import runpy, sys
from dissertation.simulation import still
still.OVERSAMPLING = 1  # a quarter of the pixels to render
for command in sys.argv[1:]:
    sys.argv = command.split()[1:]
    if "loop.py" in command:  # the film of the front page, with a tenth of its frames
        from dissertation.scraping.world import scene_still
        scene_still.FRAMES_PER_S /= 10
    if "report" in command:  # figures that nobody looks at: to arrange them takes longer than to draw them
        from structlearn.reporting import figure_style
        figure_style.STYLE |= {"figure.constrained_layout.use": False, "axes.titley": 1.0}
    if "stages.learn" in command:  # a quarter of the presses for the constants of Gaussian processes
        from structlearn.tasks.touch import skin_readings
        skin_readings.TUNING_SAMPLES = 100
    if sys.argv[0] == "-m":
        del sys.argv[0]
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    else:
        runpy.run_path(sys.argv[0], run_name="__main__")
"""


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


DIGESTS = Path(__file__).with_name("reduced_digests.txt")
LIBC = "2.36"
"""Version of glibc whose mathematical functions made the digests, on an x86-64 processor with AVX2."""


def same_libraries() -> bool:
    """Whether this machine's processor and C library are those that promise the bits of `DIGESTS`."""
    known = Path("/proc/cpuinfo")
    return platform.libc_ver() == ("glibc", LIBC) and known.exists() and " avx2 " in known.read_text()


def digests(project: Path) -> dict[str, str]:
    """SHA-256 (16 hexadecimal digits) of each output in `data`, by path."""
    stages, digest = read_yaml(project / "dvc.yaml")["stages"].values(), {}
    for out in sorted(out for stage in stages for out in stage["outs"] if isinstance(out, str)):
        path = project / out
        files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
        if out.startswith("data/"):
            whole = hashlib.sha256()
            for file in files:
                whole.update(file.relative_to(project).as_posix().encode() + b"\0" + file.read_bytes())
            digest[out] = whole.hexdigest()[:16]
    return digest


def read_digests() -> dict[str, str]:
    """The committed digests, in the form of `digests`."""
    return dict(reversed(line.split()) for line in DIGESTS.read_text().splitlines())


def main() -> None:
    """Write `DIGESTS`."""
    with tempfile.TemporaryDirectory() as folder:
        made = digests(by_hand(clone(Path(__file__).parents[1], Path(folder))))
    DIGESTS.write_text("".join(f"{digest}  {path}\n" for path, digest in made.items()))


if __name__ == "__main__":
    main()
