"""A task of logs, touches and reaches past obstacles, without demonstrations: from files to its page."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import test_own_motion
import test_own_obstacles
import test_own_touch
import yaml
from committed import merged

from structlearn.readers import write_recordings
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.joint_log import write_joint_log
from structlearn.readers.recording import Recording, Stream
from structlearn.reporting.document import words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.rigid_body.tree import read_urdf

STAGES = ("import_task", "motion", "touch", "obstacles", "report")
ENTRY = {
    "source": None,
    "motion": {
        "source": "logs",
        "urdf": "arm.urdf",
        "rate_hz": 50.0,
        "smoothing_hz": 20.0,
        "draws": 100,
        "gravity_n_m": 0.2,
    },
    "touch": {
        "source": "touches",
        "change": "rises",
        "air_samples": test_own_touch.AIR,
        "touched": 5.0,
        "spaces": {"seeds": 1, "pair_pool": 20000, "evaluation_pairs": 4000, "training": {"steps": 300}},
    },
    "obstacles": {
        "source": "reaches",
        "topics": {"pose": "/pose", "obstacles": "/obstacles"},
        "folds": 2,
        "network": {"members": 1, "training": {"iterations": 2}},
        "text_network": {"training": {"iterations": 2}},
    },
}


def as_recording(one: Demonstration) -> Recording:
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(one.time), 1))
    stamps = (10**9 + np.round(1e9 * one.time)).astype(np.int64)
    pose = Stream("/pose", "pose", stamps, np.hstack([one.position, still]))
    return Recording(one.name, (pose,), shapes=one.shapes, provenance={"origin": "recorded"})


@pytest.fixture(scope="module")
def page(root, tmp_path_factory) -> Path:
    """A folder in which all stages of the task were run."""
    folder = tmp_path_factory.mktemp("task")
    committed = yaml.safe_load((root / "stages/own/params.yaml").read_text())
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("stages/own").mkdir(parents=True)
        values = {"defaults": committed["defaults"], "tasks": {"lab": ENTRY}}
        Path("stages/own/params.yaml").write_text(yaml.safe_dump(values))
        Path("arm.urdf").write_text(test_own_motion.ARM)
        Path("logs").mkdir()
        for seed in range(2):
            log = test_own_motion.made_up_log(test_own_motion.arm()[0], f"log {seed}", seed)
            write_joint_log(log, f"logs/{log.name}.mcap")
        Path("touches").mkdir()
        for seed in range(2):
            log = test_own_touch.made_up(f"touch {seed}", seed, 400)
            table = pd.DataFrame(log.counts, columns=log.channels)
            table[["x_m", "y_m", "z_m"]] = log.place
            table.to_csv(f"touches/{log.name}.csv", index=False)
        write_recordings([as_recording(one) for one in test_own_obstacles.recordings()], "reaches")
        patch.setattr(sys, "argv", ["stage", "lab"])
        for stage in STAGES:
            runpy.run_path(str(root / f"stages/own/{stage}.py"), run_name="__main__")
    return folder


def test_the_page_has_a_section_for_each(page):
    text = (page / "reports/own/lab/index.html").read_text()
    for heading in ("The arm&#39;s dynamics", "The skin", "Reaches past obstacles"):
        assert heading in text
    assert words_in_view(text) < 1500
    assert all(f'id="figure-{name}"' in text for name in ("motion", "touch", "obstacles"))
    metrics = values_by_key(read_findings(page / "reports/own/lab/findings.csv"))
    assert metrics["motion_nmse_worst"] < 0.02
    assert metrics["touch_distances"] < 0.2
    assert metrics["obstacles_hits_none"] == 0.5
    assert metrics["obstacles_hits_planned"] == 0.0
    assert "Doubtful" not in text.partition('id="the-skin"')[0].partition('id="the-arm')[2]


def test_what_was_found_of_the_arm_is_there_for_others(page):
    assert read_urdf(page / "data/own/lab/motion/identified.urdf").tree.names == test_own_motion.JOINTS
    assert (page / "data/own/lab/touch/latent.safetensors").is_file()


def test_bags_of_touch_will_do_and_parts_that_a_task_lacks_say_so(root, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    committed = yaml.safe_load((root / "stages/own/params.yaml").read_text())
    bags = {"topics": {"tactile": "/tactile/0"}, "spaces": {"training": {"steps": 5}}}
    entry = {"source": None, "clock": {"rate_hz": 20.0}, "touch": merged(ENTRY["touch"], bags)}
    Path("stages/own").mkdir(parents=True)
    values = {"defaults": committed["defaults"], "tasks": {"lab": entry}}
    Path("stages/own/params.yaml").write_text(yaml.safe_dump(values))
    log = test_own_touch.made_up("run", 0, 400)
    stamps = 10**9 + 5 * 10**7 * np.arange(len(log.counts))
    pose = np.hstack([log.place, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))])
    streams = (Stream("/pose", "pose", stamps, pose), Stream("/tactile/0", "tactile", stamps, log.counts))
    write_recordings([Recording("run", streams, provenance={"origin": "recorded"})], "touches")
    monkeypatch.setattr(sys, "argv", ["stage", "lab"])
    for stage in ("import_task", "motion", "touch", "obstacles"):
        runpy.run_path(str(root / f"stages/own/{stage}.py"), run_name="__main__")
    recordings = pd.read_parquet("data/own/lab/touch/recordings.parquet")
    assert recordings["touching"].tolist() == [400]
    absent = [
        path.name for part in ("motion", "obstacles") for path in Path(f"data/own/lab/{part}").iterdir()
    ]
    assert absent == ["absent.txt", "absent.txt"]
