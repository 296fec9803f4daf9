"""Tasks of logs, touches and reaches past obstacles: from files to their pages."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import test_own_touch
import test_task_motion
import test_tasks_obstacles
import yaml
from committed import merged, own_tasks, run_stages

from structlearn.readers import write_recordings
from structlearn.readers.bag_recording import write_joint_log
from structlearn.readers.demonstration import Demonstration, Recording, Stream
from structlearn.reporting.document import words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.rigid_body.robot import read_urdf
from structlearn.tasks.project import ENTRIES
from structlearn.tasks.task_files import TaskFiles

QUICK = {"training": {"iterations": 2}}
SPACES = {"seeds": 1, "pair_pool": 20000, "evaluation_pairs": 4000, "training": {"steps": 200}}
TASKS = {
    "motion": {"source": "logs", "urdf": "arm.urdf"}
    | {"rate_hz": 50.0, "smoothing_hz": 20.0, "draws": 100, "gravity_n_m": 0.2},
    "touch": {"source": "touches", "change": "rises", "air_samples": test_own_touch.AIR, "touched": 5.0}
    | {"rival_samples": 50, "spaces": SPACES},
    "obstacles": {"source": "reaches", "topics": {"pose": "/pose", "obstacles": "/obstacles"}}
    | {"folds": 2, "network": {"members": 1} | QUICK, "published_network": QUICK},
}
"""An entry of each kind, called like its kind."""


def as_recording(one: Demonstration) -> Recording:
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(one.time), 1))
    stamps = (10**9 + np.round(1e9 * one.time)).astype(np.int64)
    pose = Stream("/pose", "pose", stamps, np.hstack([one.position, still]))
    return Recording(one.name, (pose,), shapes=one.shapes, provenance={"origin": "recorded"})


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """A folder in which all stages of the tasks were run."""
    folder = tmp_path_factory.mktemp("task")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        own = {kind: {kind: entry} for kind, entry in TASKS.items()}
        ENTRIES.write_text(yaml.safe_dump(own))
        Path("arm.urdf").write_text(test_task_motion.ARM)
        Path("logs").mkdir()
        for seed in range(2):
            log = test_task_motion.made_up_log(test_task_motion.arm()[0], f"log {seed}", seed)
            write_joint_log(log, f"logs/{log.name}.mcap")
        Path("touches").mkdir()
        for seed in range(2):
            log = test_own_touch.made_up(f"touch {seed}", seed, 400)
            table = pd.DataFrame(log.counts, columns=log.channels)
            table[["x_m", "y_m", "z_m"]] = log.place
            table.to_csv(f"touches/{log.name}.csv", index=False)
        write_recordings([as_recording(one) for one in test_tasks_obstacles.recordings()], "reaches")
        for kind in TASKS:
            run_stages(kind, "import_task", "learn", "report")
    return folder


def test_every_kind_has_its_page(page):
    metrics = {}
    for kind, heading, figure in (
        ("motion", "The arm&#39;s dynamics", "motion"),
        ("touch", "The skin", "skin_map"),
        ("obstacles", "Reaches past obstacles", "obstacles"),
    ):
        report = page / f"reports/tasks/{kind}"
        text = (report / "index.html").read_text()
        assert heading in text
        assert words_in_view(text) < 1000
        assert f'id="figure-{figure}' in text
        metrics |= values_by_key(read_findings(report / "findings.csv"))
        assert "Doubtful" not in text or kind == "obstacles"
    assert metrics["nmse"] < 0.02 < metrics["nmse_urdf"]
    assert metrics["map_nmse"] < 0.2
    assert metrics["none_hits"] == 0.5
    assert metrics["planned_hits"] == 0.0
    # what was found is there for others
    assert read_urdf(page / "data/tasks/motion/motion/identified.urdf").tree.names == test_task_motion.JOINTS
    assert (page / "data/tasks/touch/touch/latent.safetensors").is_file()


def test_bags_of_touch_will_do(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bags = {
        "topics": {"tactile": "/tactile/0"},
        "spaces": {"training": {"steps": 5}},
        "clock": {"rate_hz": 20.0},
    }
    own_tasks(tmp_path, kind="touch", lab=merged(TASKS["touch"], bags))
    log = test_own_touch.made_up("run", 0, 400)
    stamps = 10**9 + 5 * 10**7 * np.arange(len(log.counts))
    pose = np.hstack([log.place, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))])
    streams = (Stream("/pose", "pose", stamps, pose), Stream("/tactile/0", "tactile", stamps, log.counts))
    write_recordings([Recording("run", streams, provenance={"origin": "recorded"})], "touches")
    run_stages("lab", "import_task", "learn")
    recordings = pd.read_parquet("data/tasks/lab/touch/recordings.parquet")
    assert recordings["touching"].tolist() == [400]


def test_a_public_set_that_is_damaged_says_so_on_its_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECORDED_DATA", "sets")
    own_tasks(tmp_path, kind="motion", arm={"source": "$DATA/arm", "urdf": "$DATA/arm.urdf"})
    Path("sets/arm").mkdir(parents=True)
    Path("sets/arm/log.mcap").write_text("no bag")
    Path("sets/arm.urdf").write_text(test_task_motion.ARM)
    run_stages("arm", "import_task", "learn", "report")
    left_out = TaskFiles("arm").left_out()
    assert left_out["reason"].item().startswith("arm/log.mcap: ")
    assert "arm/log.mcap: " in (tmp_path / "reports/tasks/arm/index.html").read_text()
