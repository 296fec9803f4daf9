"""The page of what was broken on purpose: numbers of each command, and what was not run is said to be so."""

import pandas as pd
import pytest
from faults.reliability import BROKEN_BY, keep, outcome_table, reliability_page

from structlearn.core.artefacts import read_metrics
from structlearn.reporting.document import source_commit

FAULTS = outcome_table(
    [
        ("a.mcap", "yes", "hole", "named", 3),
        ("a.mcap", "yes", "noise", "same", 2),
        ("b.txt", "no", "hole", "other", 1),
    ],
    ["file", "checksums", "damage"],
    ["same", "named", "other", "hangs"],
)
COUNTS = {
    **{"files": 6, "silent": 0, "broken": 0, "named_in_one_line": 3, "same_data": 2, "other_data": 1},
    **{"traceback": 0, "hangs": 0, "out_of_memory": 0},
}


def test_each_command_keeps_its_own_and_leaves_the_others(tmp_path):
    keep("faults", FAULTS, "make faults N=6", COUNTS, tmp_path)
    crashes = pd.DataFrame([("a new file", 7, 7)], columns=["work", "crash points", "healed"])
    keep("crashes", crashes, "make kills N=1", {"points": 7, "broken": 0}, tmp_path)
    keep("faults", FAULTS, "make faults N=7", COUNTS, tmp_path)
    metrics = read_metrics(tmp_path / "metrics.json")
    assert metrics["faults_commit"] == metrics["crashes_commit"] == source_commit(BROKEN_BY)
    assert (metrics["faults_command"], metrics["crashes_command"]) == ("make faults N=7", "make kills N=1")
    assert (metrics["faults_files"], metrics["crashes_points"]) == (6, 7)
    page = (tmp_path / "index.html").read_text()
    for words in (
        f"made by <code>make faults N=7</code>, commit {metrics['faults_commit']}",
        "Kills: not run",
    ):
        assert words in page
    assert {path.name for path in tmp_path.iterdir()} == {"index.html", "metrics.json"} | {
        name for name in ("crashes.csv", "faults.csv", "kills.csv") if f'href="{name}"' in page
    }


@pytest.mark.parametrize(("broken", "words"), [(0, "The rule held."), (2, "The rule was broken 2 times.")])
def test_the_page_says_whether_the_rule_held(broken, words):
    metrics = {f"faults_{key}": value for key, value in (COUNTS | {"command": "x", "broken": broken}).items()}
    assert f"<strong>{words}" in reliability_page({"faults": FAULTS}, metrics)
