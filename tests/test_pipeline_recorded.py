"""The pipeline on recorded data, end to end, on reduced parameters, and what must hold of the recordings."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from reduced_pipeline import by_hand, clone, repro

from structlearn.tasks.public.public_files import RecordedFiles

FILE = "stages/recorded/dvc.yaml"


@pytest.fixture(scope="module")
def project(root, recorded_data, reduced_project, tmp_path_factory) -> Path:
    """Every stage has run, without DVC."""
    project = clone(root, tmp_path_factory.mktemp("recorded"))
    simulated = "data/raw/scraping/unrolls"  # whose touch is compared with what was recorded
    shutil.copytree(reduced_project / simulated, project / simulated)
    return by_hand(project, file=FILE, RECORDED_DATA=str(recorded_data.resolve()))


@pytest.fixture(scope="module")
def tables(project) -> dict[str, pd.DataFrame]:
    return RecordedFiles(project / "data").tables()


@pytest.fixture(scope="module")
def values(project) -> dict[str, float]:
    """Metrics and details of the report."""
    files = (project / f"reports/recorded/{name}.json" for name in ("metrics", "details"))
    return {key: value for file in files for key, value in json.loads(file.read_text()).items()}


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """Four reaches that are made up."""
    source = tmp_path_factory.mktemp("source")
    reaches = source / "clmc/cart_coord_dmp/dataset1"
    reaches.mkdir(parents=True)
    for number, duration in zip((2, 31, 32, 120), (0.6, 0.7, 0.8, 0.65), strict=True):
        time = np.arange(0.0, duration, 1e-3)
        s = (time / time[-1])[:, None]
        position = [0.67, -0.19, 0.14] + s**3 * (10 - 15 * s + 6 * s**2) * [-0.27, 0.39, 0.03 + 1e-4 * number]
        velocity = np.gradient(position, 1e-3, axis=0)
        np.savetxt(
            reaches / f"{number}.txt", np.column_stack([time, position, velocity, 0 * velocity]), "%.6f"
        )
    return source


@pytest.fixture(scope="module")
def few(root, source, tmp_path_factory) -> Path:
    """Every stage has run on all that this source holds."""
    return by_hand(clone(root, tmp_path_factory.mktemp("few")), file=FILE, RECORDED_DATA=str(source))


def test_the_pipeline_goes_on_with_what_there_is(few):
    found = RecordedFiles(few / "data")
    names = set(found.tables())
    assert names == {"reach_errors", "cut_errors"}
    assert set(found.tables()["reach_errors"]["demonstration"]) == {"002", "031", "032", "120"}
    assert not list((few / "data/recorded/dynamics").iterdir())
    page = (few / "reports/recorded/index.html").read_text()
    assert page.count("Not recorded here.") == 10
    claims = pd.read_csv(few / "reports/recorded/tables/claims.csv")
    tested = set(claims.loc[claims["verdict"] != "not tested", "set"])
    assert tested == {"Reaches"}
    assert [path.stem for path in (few / "reports/rerun/recorded").glob("*.rrd")] == ["reaches"]
    assert "No scraping execution" in (few / "reports/calibration/index.html").read_text()


def test_what_cannot_be_read_is_left_out_and_named_and_the_rest_goes_on(few, source, tmp_path):
    def imported(folder: Path) -> subprocess.CompletedProcess[str]:
        variables = os.environ | {"RECORDED_DATA": str(folder)}
        script = [sys.executable, "stages/recorded/import_recordings.py"]
        return subprocess.run(script, cwd=few, env=variables, capture_output=True, text=True)

    damaged = tmp_path / "clmc/cart_coord_dmp/dataset1/1.txt"
    damaged.parent.mkdir(parents=True)
    damaged.write_text("0 1 2\n")
    for folder, complaint in ((tmp_path, "line 1 has 3 columns"), (tmp_path / "none", "no such folder")):
        done = imported(folder)
        assert done.returncode == 1
        assert complaint in done.stderr
    assert len(RecordedFiles(few / "data").runs("reaches")) == 4  # nothing could be read, all stays
    shutil.copytree(source / "clmc", tmp_path / "clmc", dirs_exist_ok=True)
    (tmp_path / "ur10e").mkdir()
    (tmp_path / "ur10e/ur-1.csv").write_text("1e99" + ",0" * 30 + "\n")
    done = imported(tmp_path)
    assert done.returncode == 0
    assert len(done.stderr.splitlines()) == 3
    assert len(RecordedFiles(few / "data").runs("reaches")) == 4
    left_out = RecordedFiles(few / "data").left_out()
    assert left_out["set"].tolist() == ["reaches", "ur10e", "ur10e"]
    assert left_out["reason"][0].startswith("clmc/cart_coord_dmp/dataset1/1.txt: line 1 has 3 columns")
    assert "line 1: time out of range" in left_out["reason"][1]
    script = [sys.executable, "stages/recorded/report.py"]
    subprocess.run(script, cwd=few, check=True)
    assert "line 1 has 3 columns" in (few / "reports/recorded/index.html").read_text()


def test_everything_is_shown(project):
    assert json.loads((project / "reports/calibration/metrics.json").read_text())["compared"]
    recordings = {path.stem for path in (project / "reports/rerun/recorded").glob("*.rrd")}
    assert {"reaches", "corrected_reaches", "unscrewing", "scraping_recorded", "slides"} <= recordings


def test_the_import_runs_whenever_dvc_is_asked_for_anything(few, source):
    asked, variables = f"{FILE}:reaches", {"RECORDED_DATA": str(source)}
    assert repro(few, asked, **variables) == [f"{FILE}:code", f"{FILE}:import_recordings", asked]
    assert repro(few, asked, **variables) == [f"{FILE}:import_recordings"]


def test_reaches_are_found_between_rests(values):
    assert values["reach_cut_error_ms_0p5mm"] < 25.0
    assert values["reach_cut_error_ms_2mm"] <= 40.0


def test_one_primitive_serves_all_reaches(tables, values):
    errors = tables["reach_errors"]
    learned = errors[errors["variant"] == "learned from"]
    assert len(learned) == 97
    assert learned["mean_mm"].mean() <= 16.7
    assert learned["end_mm"].max() <= 0.4
    assert set(errors["variant"].value_counts()) == {97}  # also left out, and without scaling
    assert abs(values["reach_own_spread_mm"] - 17.3) < 0.2


def test_phase_alone_reproduces_the_higher_reaches(tables):
    distances, scores = tables["coupling_distances"], tables["coupling_scores"]
    means = distances.groupby("split")[["nominal_mm", "coupling_mm", "spread_mm"]].mean().mean()
    assert means["nominal_mm"] > 55.0
    assert means["coupling_mm"] < 20.0
    assert abs(means["coupling_mm"] - means["spread_mm"]) < 1.0  # as good as their own mean
    assert (distances["coupling_mm"] < distances["nominal_mm"]).all()
    assert distances["end_share"].mean() < 0.02
    assert scores["target_end_share"].max() < 0.02


def test_unscrewing_turns_nearly_all_the_way_round(tables):
    errors = tables["unscrewing_errors"]
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    assert (single["turn_deg"] > 340.0).all()
    assert single["mean_deg"].mean() <= 2.5
    assert joint["mean_deg"].item() <= 1.5
    assert errors["end_deg"].max() <= 0.5


def test_scraping_execution_is_reproduced_as_a_sequence(tables):
    errors, scores = tables["sequence_errors"], tables["electrode_scores"]
    assert errors["mean_mm"].max() < 1.0
    assert errors["mean_deg"].max() < 1.0
    sequence = tables["sequence"]
    switches = np.flatnonzero(np.diff(sequence["primitive"].factorize()[0]))
    assert len(switches) == 2
    for signal in (["ax", "ay", "az"], ["dwx", "dwy", "dwz"]):
        jumps = sequence[signal].diff().abs().to_numpy()[switches + 1]
        assert jumps.max() < 0.05 * sequence[signal].abs().max(axis=None)
    assert len(scores) == 3 * 38
    assert scores[scores["range"] > 20]["nmse"].mean() < 0.1


def test_slides_deviate_more_on_another_material(tables):
    by_group = tables["slide_deviations"].groupby("group")["rms"]
    assert by_group.count().to_dict() == {"learned": 11, "left out": 1, "other material": 12}
    assert by_group.mean()["other material"] > by_group.mean()["learned"]
    alone = tables["slide_left_one_out"].groupby("material")
    assert alone.size().to_dict() == {"mat15": 12, "mat9": 11}
    learned = tables["slide_deviations"].query("group == 'learned'").set_index("demonstration")["rms"]
    left_out = tables["slide_left_one_out"].set_index("demonstration")["rms"]
    assert (left_out[learned.index] > learned).all()  # training data are always predicted better
    assert set(tables["slide_statistics"]["electrode"]) == set(range(1, 20))
    clock = tables["clock_errors"].set_index("kind")
    assert clock.loc["pose", "rms_error"] < 2e-4  # m, with every second sample held out
