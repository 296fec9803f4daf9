"""The pipeline on recorded data, end to end, on reduced parameters in a temporary clone."""

import json

from reduced_pipeline import clone, repro


def test_recorded_data_have_a_pipeline_of_their_own(root, recorded_data, tmp_path):
    project = clone(root, tmp_path)
    ran = repro(project, "stages/recorded/dvc.yaml", RECORDED_DATA=str(recorded_data.resolve()))
    stages = {stage.split(":")[-1] for stage in ran}
    assert {
        "import_recordings",
        "reaches",
        "corrected_reaches",
        "unscrewing",
        "scraping",
        "slides",
        "avoidance",
        "dynamics",
        "latent_touch",
    } <= stages
    assert {"inspect", "report"} <= stages
    values = json.loads((project / "reports/recorded/metrics.json").read_text())
    assert values["reach_cut_error_ms_2mm"] <= 40.0
    recordings = {path.stem for path in (project / "reports/recordings/recorded").glob("*.rrd")}
    assert {"reaches", "corrected_reaches", "unscrewing", "scraping_recorded", "slides"} <= recordings
    again = repro(project, "stages/recorded/dvc.yaml", RECORDED_DATA=str(recorded_data.resolve()))
    assert [stage.split(":")[1] for stage in again] == ["import_recordings"]  # it always looks
