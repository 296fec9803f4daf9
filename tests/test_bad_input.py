"""Bad input to a stage: one clear line on standard error, exit code 1, nothing half-written."""

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from committed import own_tasks, parameter_tree, run_stages
from feedback_toy import toy_dataset
from readers_bags import pose_messages, pose_rows, write_bag
from scraping_motions import CHANNELS, NAMES, scraping_skill, simulated

from structlearn.core.artefacts import write_table
from structlearn.feedback.coupling_dataset import to_table
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.readers import synchronise
from structlearn.readers.demonstration import write_runs
from structlearn.tasks.project import STAGES

TOPIC = "/tool"


@pytest.fixture
def project(tmp_path, monkeypatch) -> Path:
    """An empty project with the real parameters, and a task whose demonstrations come from `bags`."""
    write_parameters(parameter_tree({}), tmp_path)
    move = {"name": "down", "axis": "z", "threshold_m_s": 0.02}
    own_tasks(tmp_path, task={"source": "bags", "topics": {"pose": TOPIC}, "segment": {"primitives": [move]}})
    (tmp_path / "bags").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["stage", "task"])
    return tmp_path


def write_parameters(parameters: dict, folder: Path) -> None:
    (folder / "params.yaml").write_text(yaml.dump(parameters, Dumper=yaml.CSafeDumper))


def contents() -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def complaint(root: Path, stage: str, capsys) -> str:
    """What a stage says when it fails, after checking that it left everything as it was."""
    before = contents()
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(
            str(STAGES / stage if "/" not in stage else root / "stages" / stage), run_name="__main__"
        )
    assert exit_.value.code == 1
    assert contents() == before
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    return lines[0]


def clock(count: int = 400) -> np.ndarray:
    return 10**9 + np.arange(count) * 3_333_333


BAG = Path("bags/one.mcap")


def faulty(change=lambda stamps, rows: None, kept=1.0) -> None:
    """A bag of which stamps or poses are changed, or of which a part is kept."""
    stamps, rows = clock(), pose_rows(400)
    change(stamps, rows)
    logged = clock().tolist()  # the recorder's own clock is sound
    write_bag(BAG, pose_messages(stamps, rows, TOPIC, logged))
    BAG.write_bytes(BAG.read_bytes()[: int(kept * BAG.stat().st_size)])


def touchless(path: Path | str) -> None:
    write_runs([synchronise(one) for one in simulated(count=1)], path)


def skill_alone() -> None:
    """Of which nothing was corrected yet."""
    skill = scraping_skill()
    write_primitives(skill.primitives, "data/primitives/scraping/primitives.safetensors")
    for name, traces in skill.expected.items():
        write_vector_primitive(traces, f"data/feedback/scraping/expected/{name}.safetensors", "counts")


def without_touch() -> None:
    """Corrections that cannot be learned from."""
    skill_alone()
    touchless("data/runs/scraping/corrections/5.parquet")


def cut_off_dataset() -> None:
    """Beside results of an earlier run."""
    folder = Path("data/feedback/scraping")
    samples = to_table(toy_dataset(settings=(2.5, 5.0, 7.5, 10.0), channels=CHANNELS))
    for name in NAMES[1:]:
        write_table(samples, folder / f"dataset/{name}.parquet")
    file = folder / "dataset/turn.parquet"
    file.write_bytes(file.read_bytes()[:1000])
    (folder / "comparison").mkdir()
    (folder / "comparison/scores.parquet").write_text("of an earlier run")


def at_rest() -> None:
    """Demonstrations that cannot be cut."""
    write_bag(BAG, pose_messages(clock(), np.tile(pose_rows(1), (400, 1)), TOPIC))
    run_stages("task", "import_task")


IMPORT, COUPLING = "import_task.py", "scraping/coupling_dataset.py"
MISSPELT, NOMINAL = parameter_tree({"segment": {"extention_s": 0.2}}), "data/runs/scraping/nominal.parquet"
CASES = {
    "truncated": (lambda: faulty(kept=0.5), IMPORT, str(BAG)),
    "nan": (lambda: faulty(lambda stamps, rows: rows[7].fill(np.nan)), IMPORT, f"{BAG}.*row 7"),
    "clock back": (lambda: faulty(lambda stamps, rows: stamps.put(20, stamps[18])), IMPORT, f"{BAG}.*row 20"),
    "parameter": (
        lambda: write_parameters(MISSPELT, Path()), "scraping/segment.py",
        "segment.extention_s: unknown parameter",
    ),
    "artefact": (
        lambda: touchless(NOMINAL), "scraping/fit_primitives.py", "scraping/cuts.parquet: no such file"
    ),
    "at rest": (at_rest, "segment.py", "one: primitive 'down': its speed never exceeds"),
    "corrections": (skill_alone, COUPLING, "corrections: no such folder; run the stage that writes it"),
    "touch": (without_touch, COUPLING, "error: 01: has no tactile stream, which feedback is learned from"),
    "dataset": (cut_off_dataset, "scraping/compare_models.py", "turn.parquet: not a readable Parquet file"),
}  # fmt: skip
"""What is bad, the stage, and the message."""


@pytest.mark.parametrize("name", CASES)
def test_bad_input_is_one_line_and_leaves_the_former_results(root, project, capsys, name):
    prepare, stage, words = CASES[name]
    prepare()
    assert re.search(words, complaint(root, stage, capsys))
