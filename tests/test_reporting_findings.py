"""The table of findings: one row per number, its interval, n and population."""

import numpy as np
import pytest

from structlearn.core.artefacts import write_csv
from structlearn.reporting.evidence import Evidence, mean
from structlearn.reporting.findings import Findings, read_findings, values_by_key

SAMPLES = np.array([1.0, 2.0, 4.0])


def test_a_row_has_its_interval_unit_and_population(tmp_path):
    find = Findings("robots")
    find.mean("error", SAMPLES, unit="mm", headline=True)
    find.among("people", study="toy/people").share("hits", 3, 60)
    find.unknown("stopped", "no robot moved")
    write_csv(find.table(), tmp_path / "findings.csv")
    table = read_findings(tmp_path / "findings.csv").set_index("name")
    assert table.loc["error", ["n", "unit", "population", "headline"]].tolist() == [3, "mm", "robots", True]
    assert table.loc["error", "low"] == pytest.approx(mean(SAMPLES).low, rel=1e-5)
    assert table.loc["hits", ["study", "population"]].tolist() == ["toy/people", "people"]
    assert table.loc["stopped", "reason"] == "no robot moved"
    assert set(values_by_key(table.reset_index())) == {"error", "hits"}


def test_cases_cover_together_and_one_without_samples_widens_nothing():
    find = Findings()
    found = find.mean("error", {"a": SAMPLES, "b": 2 * SAMPLES, "c": SAMPLES[:0]}, missing="c never ran")
    assert found["a"] == find["error"]["a"] == mean(SAMPLES, comparisons=2)
    assert found["a"].refuting[0] < found["a"].low
    assert found["c"].reason == "c never ran"
    assert list(find.numbers()) == ["error_a", "error_b"]


def test_arguments_of_a_case_may_be_several():
    found = Findings().difference("gain", {"a": (SAMPLES, 0.5 * SAMPLES)})
    assert found["a"].value == pytest.approx(SAMPLES.mean() / 2)


def test_names_are_unique_and_whole_numbers_are_integers():
    find = Findings()
    assert isinstance(find.exact("robots", 5), Evidence)
    assert isinstance(find.numbers()["robots"], int)
    with pytest.raises(ValueError, match="two findings are called robots"):
        find.exact("robots", 6)


def test_rows_can_be_made_headlines_afterwards():
    find = Findings()
    find.exact("error", {"a": 1.0, "b": 2.0})
    find.mark({"error": ("b",), "gone": True})
    assert find.table().query("headline")["case"].tolist() == ["b"]
