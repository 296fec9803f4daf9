"""The pipeline of tasks on public sets, end to end, on reduced parameters: on all, and on very few."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from committed import SETS, read_yaml
from reduced_pipeline import by_hand, clone, recorded_project, repro

from structlearn.reporting.document import words_in_view
from structlearn.reporting.findings import read_findings, values_by_key

ARRIVED = "servo_length_ratio"
"""Claim on the trials that arrive: after so little training none may."""


@pytest.fixture(scope="module")
def sets() -> list[str]:
    """Names of all public sets."""
    return [name for tasks in read_yaml(SETS / "public.yaml").values() for name in tasks]


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """Four reaches that are made up, and a file that is none."""
    source = tmp_path_factory.mktemp("source")
    reaches = source / "clmc/cart_coord_dmp/dataset1"
    reaches.mkdir(parents=True)
    (reaches / "3.txt").write_text("0 1 2\n")
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
    project = clone(root, tmp_path_factory.mktemp("few"))
    (project / "data/raw/scraping/unrolls").mkdir(parents=True)
    return by_hand(recorded_project(project, source), RECORDED_DATA=str(source))


def test_everything_that_is_here_is_shown(root, recorded_data, reduced_project, tmp_path, sets):
    project = clone(root, tmp_path)
    simulated = "data/raw/scraping/unrolls"  # whose touch is compared with what was recorded
    shutil.copytree(reduced_project / simulated, project / simulated)
    project = by_hand(recorded_project(project, recorded_data), RECORDED_DATA=str(recorded_data.resolve()))
    index = (project / "reports/recorded/index.html").read_text()
    assert "Not recorded here" not in index
    assert all(f'href="../tasks/{name}/index.html"' in index for name in sets)
    claims = pd.read_csv(project / "reports/recorded/tables/claims.csv", keep_default_na=False)
    untested = claims.loc[claims["verdict_of_all"] == "not tested", "evidence"]
    assert set(untested) <= {ARRIVED}
    assert "There is no skill file" in (project / "reports/tasks/unscrewing/index.html").read_text()
    found = values_by_key(read_findings(project / "reports/tasks/reaches/findings.csv"))
    assert found["coupling_path_mean_mm"] < 0.5 * found["nominal_path_mean_mm"]
    for name in ("reaches", "slides", "eflesh", "ur10e", "boxes"):
        assert list((project / f"reports/tasks/{name}/rerun").glob("*.rrd")), name


def test_the_pipeline_goes_on_with_what_there_is(few, sets):
    index = (few / "reports/recorded/index.html").read_text()
    assert index.count("Not recorded here.") == len(sets) - 1
    claims = pd.read_csv(few / "reports/recorded/tables/claims.csv", keep_default_na=False)
    tested = set(claims.loc[claims["verdict"] != "not tested", "set"])
    assert tested == {"Reaches and corrections"}
    page = (few / "reports/tasks/reaches/index.html").read_text()
    assert "line 1 has 3 columns" in page
    assert words_in_view(page) <= 1100
    assert len(list((few / "reports/tasks").glob("*/rerun/*.rrd"))) >= 1


def test_the_import_runs_whenever_dvc_is_asked_for_anything(few, source):
    asked, variables = "segment@reaches", {"RECORDED_DATA": str(source)}
    assert repro(few, asked, **variables) == ["import_movement@reaches", asked]
    assert repro(few, asked, **variables) == ["import_movement@reaches"]
    code = few / ".structlearn.yaml"
    text = code.read_text()
    code.write_text(re.sub("(?m)^viewer: .*", "viewer: changed", text))
    assert repro(few, asked, **variables) == ["import_movement@reaches"]
    code.write_text(re.sub("(?m)^segmentation: .*", "segmentation: changed", text))
    assert repro(few, asked, **variables) == ["import_movement@reaches", asked]
