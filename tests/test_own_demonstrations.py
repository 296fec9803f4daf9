"""A user's own bags through every stage to the report."""

import json
import runpy
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import yaml
from committed import NO_TOPICS, committed, merged
from conftest import minimum_jerk
from recordings_bags import pose_messages, write_bag

from structlearn.feedback.skill import ReactiveSkill, read_skill
from structlearn.primitives.fitting import FitParameters, learn_sequence
from structlearn.recordings import write_recordings
from structlearn.recordings.clock import synchronise
from structlearn.recordings.recording import Recording
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.segments import cut
from structlearn.testbeds.scraping.protocol.executions import corrected_runs, executions, nominal_runs
from structlearn.testbeds.scraping.world.demonstrator import DemonstratorParameters
from structlearn.testbeds.scraping.world.guided_demonstrations import guided_demonstrations
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

STAGES = (
    "scraping/record_nominal.py",
    "scraping/segment.py",
    "scraping/sweep.py",
    "scraping/fit_primitives.py",
    "scraping/expected_traces.py",
    "scraping/record_corrections.py",
    "scraping/coupling_dataset.py",
    "scraping/train_feedback.py",
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


def report_values() -> dict:
    """Headline figures and details of the report."""
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
    (tmp_path / "bags").mkdir()
    for number, (duration, rest) in enumerate([(1.0, 0.5), (1.3, 0.7), (0.8, 0.4)], start=1):
        write_reach(tmp_path / "bags" / f"take_{number}.mcap", duration, rest)
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    parameters["record"] = {"source": "bags", "topics": {"pose": "/arm/pose"} | NO_TOPICS}
    parameters["segment"]["primitives"] = [{"name": "reach", "axis": "xyz", "threshold_m_s": 0.05}]
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(parameters))
    monkeypatch.chdir(tmp_path)
    for stage in STAGES:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")
    values = report_values()
    assert values["demonstrations"] == 3
    assert not values["simulated"]
    assert values["fit_reach_mean_mm"] < 2.0
    assert not any(name.startswith(("sweep", "cut_error", "wls_wins")) for name in values)
    page = Path("reports/scraping/index.html").read_text()
    assert "noise_sweep" not in page
    assert 'class="badge"' not in page  # nothing on it is simulated


def as_recorded(recordings: Iterable[Recording]) -> list[Recording]:
    """The same streams as a robot would have recorded them: nobody knows where the primitives lie."""
    return [Recording(one.name, one.streams, None, {"origin": "recorded"}) for one in recordings]


def test_own_executions_and_corrections_give_feedback_models(root, tmp_path, monkeypatch):
    testbed = committed(TestbedParameters, "testbed")
    nominal = guided_demonstrations(committed(DemonstratorParameters, "simulate", count=4), testbed)
    demonstrations = [synchronise(recording, 300.0) for recording in nominal]
    parameters = yaml.safe_load((root / "params.yaml").read_text())
    segmentation = cut(demonstrations, committed(SegmentParameters, "segment"))
    skill = ReactiveSkill(
        learn_sequence(demonstrations, segmentation.results, committed(FitParameters, "fit_primitives"))
    )
    write_recordings(as_recorded(nominal), tmp_path / "bags" / "nominal")
    write_recordings(
        as_recorded(executions(skill, nominal_runs(2), testbed)), tmp_path / "bags" / "executions"
    )
    corrected = as_recorded(executions(skill, corrected_runs([5.0], 3), testbed))
    write_recordings(corrected, tmp_path / "bags" / "corrections" / "5")

    topics = NO_TOPICS | {"pose": "/pose", "wrench": "/wrench", "tactile": ["/tactile/0", "/tactile/1"]}
    parameters["record"] = {"source": "bags/nominal", "topics": topics}
    parameters["expected_traces"]["source"] = "bags/executions"
    parameters["record_corrections"] |= {"source": "bags/corrections", "settings_deg": [5]}
    parameters["coupling_dataset"]["settings_deg"] = [5]
    quick = {"hidden": [8], "pointwise": {"steps": 100}, "unrolled": {"steps": 10}}
    parameters["train_feedback"] = merged(parameters["train_feedback"], quick)
    parameters["compare_models"] |= {"steps": 20, "evaluate_every": 10}
    parameters["time_controller"]["ticks"] = 200
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(parameters))
    monkeypatch.chdir(tmp_path)
    for stage in STAGES:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")

    values = report_values()
    assert values["pmnn_prim2_generalization_nmse"] > 0.0
    assert not any(name.startswith("cost_ratio") for name in values)  # the board is the simulated one
    axis = np.array(parameters["coupling_dataset"]["axis"])
    model = "data/feedback/scraping/models/pointwise.safetensors"
    learned = read_skill(
        "data/primitives/scraping/primitives.safetensors", "data/feedback/scraping/expected", model, axis
    )
    assert set(learned.networks) == {"turn", "scrape"}
    assert learned.channels == 38
