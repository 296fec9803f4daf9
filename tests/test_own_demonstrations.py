"""A user's own bags of another task, position only, through every stage to the report."""

import json
import runpy
from pathlib import Path

import numpy as np
import yaml
from conftest import minimum_jerk
from recordings_bags import pose_messages, write_bag

STAGES = (
    "scraping/record.py",
    "scraping/segment.py",
    "scraping/sweep.py",
    "scraping/fit_primitives.py",
    "scraping/view.py",
    "scraping/report.py",
    "report.py",
)


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
    parameters["record"] = {"source": "bags", "topics": {"pose": "/arm/pose"}}
    parameters["segment"]["primitives"] = [{"name": "reach", "axis": "xyz", "threshold_m_s": 0.05}]
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(parameters))
    monkeypatch.chdir(tmp_path)
    for stage in STAGES:
        runpy.run_path(str(root / "stages" / stage), run_name="__main__")
    values = json.loads(Path("reports/scraping/metrics.json").read_text())
    assert values["demonstrations"] == 3
    assert not values["simulated"]
    assert values["fit_reach_mean_mm"] < 2.0
    assert not any(name.startswith(("sweep", "cut_error", "wls_wins")) for name in values)
    page = Path("reports/scraping/index.html").read_text()
    assert "noise_sweep" not in page
    assert 'class="badge"' not in page  # nothing on it is simulated
