"""Public movements, made up in the layout of their repository: from text logs to pages with verdicts."""

import runpy
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from committed import merged

from structlearn.core import quaternion
from structlearn.readers import clmc
from structlearn.reporting.document import words_in_view
from structlearn.reporting.findings import read_findings, values_by_key
from structlearn.tasks.task_files import TaskFiles

STAGES = ("import_task", "segment", "primitives", "feedback", "skill", "check", "view_movement", "report")
SMALL = {
    "reaches": {"rests": {"noise_mm": [0.0, 2.0], "seeds": 1}, "fold": 2, "corrections": {"splits": 2}},
    "unscrewing": {},
    "scraping": {},
}


def minimum_jerk(samples: int) -> np.ndarray:
    s = np.linspace(0.0, 1.0, samples)[:, None]
    return s**3 * (10 - 15 * s + 6 * s**2)


def write(path: Path, *columns: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, np.column_stack(columns), "%.6f")


def write_reach(path: Path, duration: float, height: float) -> None:
    time = np.arange(0.0, duration, 1e-3)
    way = minimum_jerk(len(time))
    position = [0.67, -0.19, 0.14] + way * [-0.27, 0.39, 0.03]
    position = position + 16 * height * (way * (1 - way)) ** 2 * [0.0, 0.0, 1.0]
    velocity = np.gradient(position, 1e-3, axis=0)
    write(path, time, position, velocity, 0 * velocity)


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A folder of public sets with three layouts in it."""
    folder = tmp_path_factory.mktemp("public")
    for number, duration in enumerate((0.6, 0.7, 0.8, 0.65), start=1):
        reaches = folder / "clmc/cart_coord_dmp"
        write_reach(reaches / f"dataset1/{number}.txt", duration, 0.02 + 0.005 * number)
        write_reach(reaches / f"dataset2/{number}.txt", duration, 0.2 + 0.005 * number)
    for log, duration in (("01", 2.0), ("02", 2.2)):
        way, table = minimum_jerk(round(300 * duration)), np.zeros((round(300 * duration), 92))
        table[:, 9:13] = quaternion.from_rotation_vector(6.1 * way * [0.0, 0.0, 1.0])
        table[:, :3] = 0.1 * way
        path = folder / f"clmc/quat_dmp_unscrewing/{log}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        time = np.arange(len(way)) / clmc.ROBOT_RATE_HZ
        np.savetxt(path, np.column_stack([time, table]), ["%.5f"] + 92 * ["%.6f"])
    for place in range(3):
        trial, way = folder / f"clmc/scraping/trial/prim{place + 1}", minimum_jerk(450)
        still = np.tile([1.0, 0.0, 0.0, 0.0], (450, 1))
        position = 0.1 * np.eye(3)[place] * way + 0.1 * np.eye(3)[:place].sum(axis=0)
        write(trial / "position", position, np.zeros((450, 6)))
        write(trial / "orientation", still, np.zeros((450, 6)))
        write(trial / "sense_proprio", np.zeros((450, 7)))
        for finger in ("LF", "RF"):
            write(trial / f"sense_R_{finger}", 40.0 * np.sin(3.0 * way) * np.arange(19))
    return folder


@pytest.fixture
def made(root, source, tmp_path, monkeypatch):
    """A function that runs all stages of a task in a project of its own, and gives its files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RECORDED_DATA", str(source))
    shutil.copytree(root / "stages/tasks", "stages/tasks")
    committed = yaml.safe_load(Path("stages/tasks/public.yaml").read_text())["movement"]
    entries = {name: merged(committed[name], changes) for name, changes in SMALL.items()}
    Path("stages/tasks/public.yaml").write_text(yaml.safe_dump({"movement": entries}))

    def run(task: str) -> TaskFiles:
        monkeypatch.setattr(sys, "argv", ["stage", task])
        for stage in STAGES:
            runpy.run_path(str(root / f"stages/tasks/{stage}.py"), run_name="__main__")
        return TaskFiles(task)

    return run


def claims(files: TaskFiles) -> pd.DataFrame:
    return pd.read_csv(files.report / "tables/claims.csv", keep_default_na=False)


@pytest.mark.parametrize(
    ("task", "recordings"), [("reaches", {"corrected"}), ("unscrewing", {"turns"}), ("scraping", set())]
)
def test_a_public_movement_goes_through_to_its_verdicts(made, task, recordings):
    files = made(task)
    assert "not tested" not in set(claims(files)["verdict"])
    page = (files.report / "index.html").read_text()
    assert page.count('class="lead"') >= 1
    assert words_in_view(page) <= 1100
    written = {path.stem for path in (files.report / "rerun").glob("*.rrd")}
    assert written == {"demonstrations", "primitives", *recordings}
    assert all(f'rerun/{name}.rrd"' in page for name in written)
    values = values_by_key(read_findings(files.report / "findings.csv"))
    if task == "reaches":
        assert values["coupling_path_mean_mm"] < 0.2 * values["nominal_path_mean_mm"]
        assert values["cuts_demonstrations"] == 4
    if task == "unscrewing":  # no controller turns that far; the page says so
        assert "There is no skill file" in page


def test_runs_and_corrections_that_are_not_there_or_not_readable_are_named(
    made, source, tmp_path, monkeypatch
):
    other = tmp_path / "other"
    shutil.copytree(source / "clmc/cart_coord_dmp/dataset1", other / "clmc/cart_coord_dmp/dataset1")
    (other / "clmc/cart_coord_dmp/dataset1/3.txt").write_text("0 1 2\n")
    monkeypatch.setenv("RECORDED_DATA", str(other))
    files = made("reaches")
    assert len(files.runs("demonstrations")) == 3
    verdicts = claims(files).set_index("statement")["verdict"]
    assert (verdicts == "not tested").sum() == 3  # of the corrections
    page = (files.report / "index.html").read_text()
    assert "line 1 has 3 columns" in page
    absent = made("scraping")
    assert set(claims(absent)["verdict"]) == {"not tested"}
    assert "Not recorded here" in (absent.report / "index.html").read_text()
