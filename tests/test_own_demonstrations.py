"""A user's own bags through every stage to the report."""

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from committed import NO_TOPICS, merged, parameter_tree
from conftest import minimum_jerk
from recordings_bags import as_recorded, pose_messages, write_bag
from reduced_pipeline import REDUCED

from structlearn.feedback.skill_file import read_skill
from structlearn.recordings import read_recordings, write_recordings

STAGES = (
    "scraping/record_nominal.py",
    "scraping/segment.py",
    "scraping/sweep.py",
    "scraping/fit_primitives.py",
    "scraping/expected_traces.py",
    "scraping/record_corrections.py",
    "scraping/coupling_dataset.py",
    "scraping/train_feedback.py",
    "scraping/write_skill.py",
    "scraping/compare_models.py",
    "scraping/evaluate_feedback.py",
    "scraping/refine.py",
    "scraping/evaluate_refinement.py",
    "scraping/compare_search.py",
    "scraping/time_controller.py",
    "scraping/view.py",
    "scraping/report.py",
    "report.py",
)


def report_values(root: Path, parameters: dict[str, Any]) -> dict[str, Any]:
    """Headline figures and details of the report, after all stages in the working directory."""
    Path("params.yaml").write_text(yaml.safe_dump(parameters))
    for stage in STAGES:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")
    return {
        key: value
        for name in ("metrics", "details")
        for key, value in json.loads(Path(f"reports/scraping/{name}.json").read_text()).items()
    }


def write_reach(path: Path, duration: float, rest: float) -> None:
    time = np.arange(0.0, duration + 2 * rest, 1 / 250)
    way = minimum_jerk((time - rest) / duration)
    position = way[:, None] * [0.3, 0.2, 0.0] + (way * (1 - way))[:, None] * [0.0, 0.0, 0.2]
    identity = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    stamps = (10**9 + np.round(1e9 * time).astype(np.int64)).tolist()
    write_bag(path, pose_messages(stamps, np.hstack([position, identity]), "/arm/pose"))


def test_another_task_goes_through_to_the_report(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bags").mkdir()
    for number, (duration, rest) in enumerate([(1.0, 0.5), (1.3, 0.7), (0.8, 0.4)], start=1):
        write_reach(Path(f"bags/take_{number}.mcap"), duration, rest)
    parameters = parameter_tree(REDUCED)
    parameters["record"] = {"source": "bags", "topics": {"pose": "/arm/pose"} | NO_TOPICS}
    parameters["segment"]["primitives"] = [{"name": "reach", "axis": "xyz", "threshold_m_s": 0.05}]
    values = report_values(root, parameters)
    assert values["demonstrations"] == 3
    assert not values["simulated"]
    assert values["fit_reach_mean_mm"] < 2.0
    assert not any(name.startswith(("sweep", "cut_error", "wls_wins")) for name in values)
    page = Path("reports/scraping/index.html").read_text()
    assert "noise_sweep" not in page
    assert 'class="badge"' not in page  # nothing on it is simulated


def test_own_executions_and_corrections_give_feedback_models(root, reduced_project, tmp_path, monkeypatch):
    """The simulated testbed's, as a robot would have recorded them."""
    monkeypatch.chdir(tmp_path)
    raw, folders = reduced_project / "data/raw/scraping", ("nominal", "unrolls", "corrections/5")
    for folder in folders:
        write_recordings(as_recorded(read_recordings(raw / folder)), Path("bags") / folder)
    topics = {"pose": "/pose", "wrench": "/wrench", "tactile": ["/tactile/0", "/tactile/1"]}
    own = {
        "record": {"source": "bags/nominal", "topics": NO_TOPICS | topics},
        "expected_traces": {"source": "bags/unrolls"},
        "record_corrections": {"source": "bags/corrections", "settings_deg": [5]},
        "coupling_dataset": {"settings_deg": [5]},
    }
    parameters = merged(parameter_tree(REDUCED), own)
    values = report_values(root, parameters)
    assert values["pmnn_prim2_generalization_nmse"] > 0.0
    assert not any(name.startswith("cost_ratio") for name in values)  # the board is the simulated one
    learned = read_skill("data/feedback/scraping/skill.safetensors")
    assert set(learned.networks) == {"turn", "scrape"}
    assert learned.axes == ("ry",)
    assert learned.channels == 38
